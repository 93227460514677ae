#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <grpcpp/server_context.h>

#include "proto/weft/v1/roles.pb.h"

namespace weft::security {

// Who makes a call.
struct Caller {
  std::string user;             // its certificate's name; empty: local, without a certificate
  std::vector<v1::Role> roles;  // its certificate's; a local caller is admin

  [[nodiscard]] bool may(v1::Role needed) const;
};

// The role that a call of weft's services needs, from its option in the proto. `call` is
// "JobService.Submit". Throws core::Error(kInternal) when there is no such call or it names no
// role: nobody may make it then.
[[nodiscard]] v1::Role role_needed(std::string_view call);

// Who makes this call: what the certificate of its connection says. Without TLS (which servers
// allow on loopback addresses, Unix sockets and with --insecure) every caller is a local admin.
// Throws core::Error(kPermissionDenied) when the certificate is not of weft's making.
[[nodiscard]] Caller caller_of(const grpc::ServerContextBase& context);

// Throws core::Error(kPermissionDenied) when the caller's certificate is not for a worker of this
// name: its own name, or that followed by '/' or '-' and whatever else. A local caller may use any.
void check_worker_name(const Caller& caller, std::string_view worker_name);

// Throws core::Error(kPermissionDenied) when the caller may not make the call, with the role that
// is needed and those that it has.
void check_role(const Caller& caller, std::string_view call);

// The caller, when it may make the call. Throws core::Error(kPermissionDenied) when it may not,
// with the role that is needed and those that it has.
Caller check_role(const grpc::ServerContextBase& context, std::string_view call);

}  // namespace weft::security
