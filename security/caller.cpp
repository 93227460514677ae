#include "security/caller.h"

#include <algorithm>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>

#include "core/error.h"
#include "security/roles.h"
#include "security/x509.h"

namespace weft::security {

namespace {

constexpr const char* kPackage = "weft.v1.";

// The peer's certificate as PEM; empty when the connection is not encrypted.
std::string certificate_of(const grpc::AuthContext& peer) {
  const auto transport = peer.FindPropertyValues(GRPC_TRANSPORT_SECURITY_TYPE_PROPERTY_NAME);
  if (transport.empty() || transport.front() == "insecure") {
    return "";
  }
  const auto pem = peer.FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  if (pem.empty()) {
    throw core::Error(core::Code::kPermissionDenied, "the connection has no certificate");
  }
  return {pem.front().data(), pem.front().size()};
}

}  // namespace

bool Caller::may(v1::Role needed) const {
  return std::any_of(roles.begin(), roles.end(),
                     [&](v1::Role role) { return includes(role, needed); });
}

v1::Role role_needed(std::string_view call) {
  const google::protobuf::MethodDescriptor* method =
      google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(kPackage +
                                                                           std::string(call));
  const v1::Role role =
      method == nullptr ? v1::ROLE_UNSPECIFIED : method->options().GetExtension(v1::needs);
  if (role == v1::ROLE_UNSPECIFIED) {
    throw core::Error(core::Code::kInternal, std::string(call) + " states no role in its proto");
  }
  return role;
}

Caller caller_of(const grpc::ServerContextBase& context) {
  const std::string pem = certificate_of(*context.auth_context());
  if (pem.empty()) {
    return {"", {v1::ROLE_ADMIN}};
  }
  try {
    Certificate certificate = read_certificate(pem);
    return {std::move(certificate.name), std::move(certificate.roles)};
  } catch (const core::Error& error) {
    throw core::Error(core::Code::kPermissionDenied,
                      std::string("the caller's certificate cannot be used: ") + error.what());
  }
}

void check_worker_name(const Caller& caller, std::string_view worker_name) {
  const std::string& own = caller.user;
  const bool begins_so = worker_name.starts_with(own);
  const std::string_view rest = begins_so ? worker_name.substr(own.size()) : worker_name;
  if (own.empty() || (begins_so && (rest.empty() || rest[0] == '/' || rest[0] == '-'))) {
    return;
  }
  throw core::Error(
      core::Code::kPermissionDenied,
      fmt::format("the certificate of '{0}' is for workers named {0}, {0}/... or {0}-..., and not "
                  "'{1}'. Start the worker with --name {0}, or give its machine a certificate of "
                  "its own (weft certs issue NAME --role worker)",
                  own, worker_name));
}

void check_role(const Caller& caller, std::string_view call) {
  const v1::Role needed = role_needed(call);
  if (!caller.may(needed)) {
    throw core::Error(core::Code::kPermissionDenied,
                      fmt::format("{} needs the role {}; the certificate of '{}' gives: {}. Ask "
                                  "whoever keeps the authority for one that does (weft certs issue "
                                  "NAME --role {})",
                                  call, to_string(needed), caller.user, to_string(caller.roles),
                                  to_string(needed)));
  }
}

Caller check_role(const grpc::ServerContextBase& context, std::string_view call) {
  Caller caller = caller_of(context);
  check_role(caller, call);
  return caller;
}

}  // namespace weft::security
