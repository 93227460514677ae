#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "security/channel.h"
#include "security/server_gate.h"
#include "security/tls_folder.h"
#include "security/tls_probe.h"
#include "tests/security_calls.h"

// The gate over real connections, in front of a service of which one call never ends by itself.

namespace weft::security {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Watched final : public v1::JobService::Service {
 public:
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* /*request*/,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override {
    writer->Write(v1::WatchJobResponse());
    while (!context->IsCancelled()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return {grpc::StatusCode::CANCELLED, "the caller is gone"};
  }
};

class SecuredServer {
 public:
  explicit SecuredServer(const Endpoint& listen) {
    gate_ = std::make_unique<ServerGate>(listen);
    gate_->builder().RegisterService(&jobs_);
    server_ = gate_->start();
    address_ = gate_->address();
  }
  ~SecuredServer() { server_->Shutdown(std::chrono::system_clock::now()); }
  SecuredServer(const SecuredServer&) = delete;
  SecuredServer& operator=(const SecuredServer&) = delete;
  SecuredServer(SecuredServer&&) = delete;
  SecuredServer& operator=(SecuredServer&&) = delete;

  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  Watched jobs_;
  std::unique_ptr<ServerGate> gate_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

constexpr const char* kSubmit = "/weft.v1.JobService/Submit";
constexpr const char* kGet = "/weft.v1.JobService/GetJob";
constexpr const char* kWatch = "/weft.v1.JobService/WatchJob";

TEST(ServerGate, ARoleOpensWhatItShould) {
  const TestAuthority authority;
  const SecuredServer server(
      Endpoint("127.0.0.1:0", authority.issue("hub", {}, {"hub.example"}), false));
  const auto channel = [&](const std::string& folder) {
    return open_channel(Endpoint(server.address(), folder, false));
  };
  const auto reader = channel(authority.issue("rita", {v1::ROLE_READER}));
  EXPECT_EQ(call(reader, kGet).error_code(), grpc::StatusCode::UNIMPLEMENTED);
  const grpc::Status refused = call(reader, kSubmit);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(refused.error_message(),
            "JobService.Submit needs the role submitter; the certificate of 'rita' gives: reader. "
            "Ask whoever keeps the authority for one that does (weft certs issue NAME --role "
            "submitter)");
  EXPECT_EQ(call(channel(authority.issue("sam", {v1::ROLE_SUBMITTER})), kSubmit).error_code(),
            grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(call(reader, "/weft.v1.JobService/Sbumit").error_code(),
            grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(call(reader, "/elsewhere.Service/Call").error_code(), grpc::StatusCode::UNIMPLEMENTED);
}

TEST(ServerGate, WhoHasNoCertificateOfTheAuthorityDoesNotGetIn) {
  const TestAuthority authority;
  const TestAuthority foreign;
  const SecuredServer server(Endpoint("127.0.0.1:0", authority.issue("hub", {}, {"hub"}), false));
  const std::string address = server.address();
  // Its own authority's certificate, trusting the server's authority: only the server can object.
  const std::string stranger = foreign.issue("eve", {v1::ROLE_ADMIN});
  std::filesystem::copy_file(authority.folder_of("hub") / "ca.pem",
                             foreign.folder_of("eve") / "ca.pem",
                             std::filesystem::copy_options::overwrite_existing);
  const auto channel = [&](const std::string& folder) {
    grpc::experimental::TlsChannelCredentialsOptions options;
    options.set_certificate_provider(
        std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
            folder + "/key.pem", folder + "/cert.pem", folder + "/ca.pem", 1));
    options.watch_root_certs();
    options.watch_identity_key_cert_pairs();
    return grpc::CreateChannel(address, grpc::experimental::TlsCredentials(options));
  };
  EXPECT_EQ(call(channel(stranger), kGet).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(call(open_channel(Endpoint(address)), kGet).error_code(),
            grpc::StatusCode::UNAVAILABLE);
  // The same channel gets in with a certificate of the authority, and gets no role's calls without
  // a role.
  EXPECT_EQ(call(channel(authority.issue("ann", {v1::ROLE_READER})), kGet).error_code(),
            grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(call(channel(authority.folder_of("hub")), kGet).error_code(),
            grpc::StatusCode::PERMISSION_DENIED);
}

TEST(ServerGate, ACallerIsToldWhyItsConnectionFails) {
  const TestAuthority authority;
  const TestAuthority foreign;
  const std::string hub = authority.issue("hub", {}, {"hub.example"});
  const SecuredServer everywhere(Endpoint("0.0.0.0:0", hub, false));
  const std::string port = everywhere.address().substr(everywhere.address().rfind(':'));
  const std::string address = "127.0.0.1" + port;
  const SecuredServer open_server("127.0.0.1:0");
  const std::string ann = authority.issue("ann", {v1::ROLE_READER});
  const std::string eve = foreign.issue("eve", {v1::ROLE_ADMIN});
  const auto problem = [](const std::string& where, const std::string& folder) {
    return tls_problem(Endpoint(where, folder, false));
  };
  EXPECT_EQ(problem(address, ann), "");
  EXPECT_EQ(problem(open_server.address(), ""), "");
  EXPECT_EQ(problem("127.0.0.1:1", ann), "");
  EXPECT_THAT(problem(address, eve), HasSubstr("of another authority ('weft') than"));
  EXPECT_THAT(problem(address, ""), HasSubstr("speaks TLS; name the folder"));
  EXPECT_THAT(problem(open_server.address(), ann), HasSubstr("does not speak TLS"));
  EXPECT_THAT(problem("127.0.0.2" + port, ann),
              AllOf(HasSubstr("for hub.example, localhost"), HasSubstr("--host 127.0.0.2")));
  std::filesystem::copy_file(hub + "/ca.pem", eve + "/ca.pem",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(problem(address, eve), HasSubstr("signed by another authority"));
}

TEST(ServerGate, AnExpiredOrMixedUpFolderIsRefusedWithAReason) {
  const TestAuthority authority;
  const auto now = TestAuthority::now();
  const auto message = [&](const std::string& folder, TlsUse use) -> std::string {
    try {
      static_cast<void>(check_tls_folder({folder}, use, now));
    } catch (const core::Error& error) {
      return error.what();
    }
    return "";
  };
  const std::string ann = authority.issue("ann", {v1::ROLE_READER});
  const std::string hub = authority.issue("hub", {}, {"hub"});
  EXPECT_EQ(message(ann, TlsUse::kCall), "");
  EXPECT_EQ(message(hub, TlsUse::kListen), "");
  EXPECT_THAT(message(ann, TlsUse::kListen), HasSubstr("is for callers only"));
  EXPECT_THAT(message(authority.issue("old", {v1::ROLE_READER}, {}, now - std::chrono::days(20)),
                      TlsUse::kCall),
              HasSubstr("expired on"));
  EXPECT_THAT(message(authority.issue("new", {v1::ROLE_READER}, {}, now + std::chrono::days(2)),
                      TlsUse::kCall),
              HasSubstr("on only; is this machine's clock right?"));
  EXPECT_THAT(message(ann + "/none", TlsUse::kCall), HasSubstr("cannot read"));
  std::filesystem::permissions(ann + "/key.pem", std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(message(ann, TlsUse::kCall), HasSubstr("chmod 600"));
  std::filesystem::copy_file(hub + "/cert.pem", ann + "/cert.pem",
                             std::filesystem::copy_options::overwrite_existing);
  std::filesystem::permissions(ann + "/key.pem", std::filesystem::perms::owner_read);
  EXPECT_THAT(message(ann, TlsUse::kCall), HasSubstr("is not the key of"));
}

TEST(ServerGate, ARevokedCertificateEndsWhatRunsAndBeginsNothing) {
  const TestAuthority authority;
  const SecuredServer server(Endpoint("127.0.0.1:0", authority.issue("hub", {}, {"hub"}), false));
  const auto ann =
      open_channel(Endpoint(server.address(), authority.issue("ann", {v1::ROLE_READER}), false));
  const auto bob =
      open_channel(Endpoint(server.address(), authority.issue("bob", {v1::ROLE_READER}), false));
  AnyCall of_ann(ann, kWatch, std::chrono::seconds(60));
  AnyCall of_bob(bob, kWatch, std::chrono::seconds(60));
  ASSERT_TRUE(of_ann.wait_for_answer());
  ASSERT_TRUE(of_bob.wait_for_answer());
  const auto written = authority.authority().revoke("ann", TestAuthority::now());
  ASSERT_EQ(written.size(), 2U);
  EXPECT_EQ(written.back(), authority.folder_of("hub") / "revoked.pem");
  EXPECT_EQ(of_ann.wait().error_code(), grpc::StatusCode::CANCELLED);
  const grpc::Status refused = call(ann, kGet);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_THAT(refused.error_message(), HasSubstr("the certificate of 'ann' was revoked on"));
  // A list that is damaged, or another authority's, changes nothing.
  core::write_file_atomically(written.back(), "nonsense");
  const TestAuthority foreign;
  EXPECT_EQ(call(ann, kGet).error_code(), grpc::StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(call(bob, kGet).error_code(), grpc::StatusCode::UNIMPLEMENTED);
  // A new certificate for the same name is good.
  const auto again =
      open_channel(Endpoint(server.address(), authority.issue("ann", {v1::ROLE_READER}), false));
  EXPECT_EQ(call(again, kGet).error_code(), grpc::StatusCode::UNIMPLEMENTED);
  EXPECT_FALSE(of_bob.is_done());
}

// The serial of the certificate that the server shows.
std::string serial_shown(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  v1::GetJobResponse response;
  v1::JobService::NewStub(channel)->GetJob(&context, {}, &response);
  const auto pem = context.auth_context()->FindPropertyValues("x509_pem_cert");
  return pem.empty() ? "" : read_certificate({pem.front().data(), pem.front().size()}).serial;
}

TEST(ServerGate, ANewCertificateIsUsedWithoutARestart) {
  const TestAuthority authority;
  const SecuredServer server(Endpoint("127.0.0.1:0", authority.issue("hub", {}, {"hub"}), false));
  const std::string ann = authority.issue("ann", {v1::ROLE_READER});
  const Endpoint endpoint(server.address(), ann, false);
  const auto before = open_channel(endpoint);
  const std::string first = serial_shown(before);
  EXPECT_NE(first, "");
  authority.issue("hub", {});  // as it was given last
  const std::string second = authority.authority().issued().back().certificate.serial;
  std::string shown;
  for (int tries = 0; tries < 300 && shown != second; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    shown = serial_shown(open_channel(endpoint));
  }
  EXPECT_EQ(shown, second);
  EXPECT_NE(first, second);
  EXPECT_EQ(call(before, kGet).error_code(), grpc::StatusCode::UNIMPLEMENTED)
      << "the old connection";
}

// A program that goes on while its own certificate is revoked and issued again.
TEST(ServerGate, ARunningCallerShowsItsNewCertificateOnItsNextConnection) {
  const TestAuthority authority;
  const std::string hub = authority.issue("hub", {}, {"hub"});
  auto server = std::make_unique<SecuredServer>(Endpoint("127.0.0.1:0", hub, false));
  const Endpoint here(server->address(), hub, false);
  constexpr int kLongestWaitMs = 200;
  const auto channel =
      open_channel(Endpoint(server->address(), authority.issue("ann", {v1::ROLE_READER}), false),
                   kLongestWaitMs);
  EXPECT_EQ(call(channel, kGet).error_code(), grpc::StatusCode::UNIMPLEMENTED);
  authority.authority().revoke("ann", TestAuthority::now());
  grpc::StatusCode code = grpc::StatusCode::UNIMPLEMENTED;
  for (int tries = 0; tries < 300 && code != grpc::StatusCode::UNAUTHENTICATED; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    code = call(channel, kGet).error_code();
  }
  ASSERT_EQ(code, grpc::StatusCode::UNAUTHENTICATED);
  authority.issue("ann", {v1::ROLE_READER});
  // The connection that there is was made with the old one. Its folder is looked at every two
  // seconds, so the first new connection may be, too.
  for (int tries = 0; tries < 30 && code != grpc::StatusCode::UNIMPLEMENTED; ++tries) {
    if (code == grpc::StatusCode::UNAUTHENTICATED) {
      server.reset();
      server = std::make_unique<SecuredServer>(here);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    code = call(channel, kGet).error_code();
  }
  EXPECT_EQ(code, grpc::StatusCode::UNIMPLEMENTED);
}

}  // namespace
}  // namespace weft::security
