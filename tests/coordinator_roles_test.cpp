#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/server.h"
#include "core/clock.h"
#include "core/digest.h"
#include "proto/weft/v1/cluster.grpc.pb.h"
#include "security/caller.h"
#include "security/roles.h"
#include "tests/security_calls.h"

// Every call of every service, with every role and with none, over TLS to a real coordinator.

namespace weft::coordinator {
namespace {

using security::Endpoint;

class RolesTest : public testing::Test {
 protected:
  void SetUp() override {
    SchedulerOptions options;
    options.state_folder = authority_.folder_of("state");
    options.commit = [](const auto&...) { return core::Digest(); };
    scheduler_ = std::make_unique<Scheduler>(std::move(options), core::system_clock());
    server_ = std::make_unique<Server>(
        *scheduler_, Endpoint("127.0.0.1:0", authority_.issue("hub", {}, {"hub"}), false));
  }
  [[nodiscard]] std::shared_ptr<grpc::Channel> channel(const std::string& folder) const {
    return security::open_channel(Endpoint(server_->address(), folder, false));
  }
  static bool is_refused(const grpc::Status& status) {
    return status.error_code() == grpc::StatusCode::PERMISSION_DENIED ||
           status.error_code() == grpc::StatusCode::UNAUTHENTICATED;
  }

  security::TestAuthority authority_;
  std::unique_ptr<Scheduler> scheduler_;
  std::unique_ptr<Server> server_;
};

// "JobService.Submit" of "/weft.v1.JobService/Submit".
std::string call_of(std::string path) {
  path = path.substr(std::string("/weft.v1.").size());
  path[path.find('/')] = '.';
  return path;
}

TEST_F(RolesTest, EveryCallIsAllowedToExactlyTheRolesThatItsOptionNames) {
  const std::vector<std::string> paths = security::paths_of(*v1::JobState_descriptor()->file());
  ASSERT_GT(paths.size(), 30U);
  for (const v1::Role role : security::kRoles) {
    const auto caller = channel(authority_.issue(security::to_string(role), {role}));
    for (const std::string& path : paths) {
      const grpc::Status status = security::call(caller, path);
      const bool is_allowed = security::includes(role, security::role_needed(call_of(path)));
      EXPECT_EQ(is_refused(status), !is_allowed)
          << path << " as " << security::to_string(role) << ": " << status.error_message();
      EXPECT_NE(status.error_code(), grpc::StatusCode::UNAVAILABLE) << path;
    }
  }
}

TEST_F(RolesTest, WithoutARoleNoCallIsAllowed) {
  // A server's certificate: of the authority, and good for a connection.
  const auto nobody = channel(authority_.folder_of("hub"));
  for (const std::string& path : security::paths_of(*v1::JobState_descriptor()->file())) {
    const grpc::Status status = security::call(nobody, path);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::PERMISSION_DENIED) << path;
  }
  const grpc::Status health = security::call(nobody, "/grpc.health.v1.Health/Check");
  EXPECT_EQ(health.error_code(), grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(RolesTest, AForeignAuthoritysCertificateAndNoneDoNotEvenGetAConnection) {
  const security::TestAuthority foreign;
  const std::string eve = foreign.issue("eve", {v1::ROLE_ADMIN});
  const auto stranger = channel(eve);
  const auto nobody = security::open_channel(Endpoint(server_->address()));
  for (const std::string& path : security::paths_of(*v1::JobState_descriptor()->file())) {
    EXPECT_EQ(security::call(stranger, path).error_code(), grpc::StatusCode::UNAVAILABLE) << path;
    EXPECT_EQ(security::call(nobody, path).error_code(), grpc::StatusCode::UNAVAILABLE) << path;
  }
}

v1::SynchronizeRequest report_of(const std::string& name, const std::string& id) {
  v1::SynchronizeRequest request;
  request.set_request_id("call-1");
  request.set_worker_id(id);
  request.set_sequence(1);
  request.set_name(name);
  request.set_threads(1);
  request.set_fingerprint(core::digest_of("a machine").binary());
  return request;
}

// As a process of its own each time, where no id is given.
grpc::Status synchronize(const std::shared_ptr<grpc::Channel>& channel, const std::string& name,
                         const std::string& id = "") {
  static int processes = 0;
  const std::string own = std::string("w").append(std::to_string(++processes));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
  v1::SynchronizeResponse response;
  return v1::WorkerService::NewStub(channel)->Synchronize(
      &context, report_of(name, id.empty() ? own : id), &response);
}

TEST_F(RolesTest, AWorkerIsCalledAsItsCertificate) {
  const auto mill = channel(authority_.issue("mill", {v1::ROLE_WORKER}));
  for (const char* const name : {"mill", "mill/2", "mill-2", "mill/", "mill/a b"}) {
    const grpc::Status status = synchronize(mill, name);
    EXPECT_TRUE(status.ok()) << name << ": " << status.error_message();
  }
  for (const char* const name : {"mil", "mill2", "Mill", "mill 2", "loom", "loom/mill", ""}) {
    const grpc::Status status = synchronize(mill, name);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::PERMISSION_DENIED) << name;
    EXPECT_NE(status.error_message().find("mill, mill/... or mill-..."), std::string::npos)
        << status.error_message();
  }
  EXPECT_EQ(scheduler_->workers().size(), 5U);
  // An admin's certificate, which may do everything, is bound alike.
  const auto root = channel(authority_.issue("root", {v1::ROLE_ADMIN}));
  EXPECT_TRUE(synchronize(root, "root/1").ok());
  EXPECT_EQ(synchronize(root, "mill").error_code(), grpc::StatusCode::PERMISSION_DENIED);
}

TEST_F(RolesTest, AWorkersIdIsNotToBeHadUnderAnotherName) {
  const auto loom = channel(authority_.issue("loom", {v1::ROLE_WORKER}));
  const auto mill = channel(authority_.issue("mill", {v1::ROLE_WORKER}));
  ASSERT_TRUE(synchronize(loom, "loom", "process").ok());
  const grpc::Status status = synchronize(mill, "mill", "process");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION) << status.error_message();
  ASSERT_EQ(scheduler_->workers().size(), 1U);
  EXPECT_EQ(scheduler_->workers()[0].name(), "loom");
}

TEST_F(RolesTest, WithoutTlsAWorkerMayHaveAnyName) {
  Server local(*scheduler_, "127.0.0.1:0");
  const auto anybody = security::open_channel(Endpoint(local.address()));
  EXPECT_TRUE(synchronize(anybody, "loom").ok());
  EXPECT_TRUE(synchronize(anybody, "mill/2").ok());
}

TEST_F(RolesTest, HealthAndReflectionAnswerWhoeverHasARole) {
  const auto worker = channel(authority_.issue("w", {v1::ROLE_WORKER}));
  security::AnyCall health(worker, "/grpc.health.v1.Health/Check", std::chrono::seconds(10));
  EXPECT_TRUE(health.wait().ok());
  EXPECT_EQ(health.answer(), std::string("\x08\x01")) << "SERVING";
  security::AnyCall reflection(worker,
                               "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                               std::chrono::seconds(10));
  EXPECT_TRUE(reflection.wait().ok());
}

}  // namespace
}  // namespace weft::coordinator
