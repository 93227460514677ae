#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "render/node/render_node.h"
#include "security/caller.h"
#include "security/roles.h"
#include "tests/security_calls.h"

// Every call of a render node, with every role and with none, over TLS.

namespace weft::render {
namespace {

using security::Endpoint;

class NodeRolesTest : public testing::Test {
 protected:
  void SetUp() override {
    RenderNodeOptions options;
    options.coordinator = "unix:" + authority_.folder_of("no-coordinator").string();
    options.cache = authority_.folder_of("cache");
    options.device = "cpu";
    node_ = std::make_unique<RenderNode>(
        options, Endpoint("127.0.0.1:0", authority_.issue("painter", {}, {"painter"}), false));
  }
  [[nodiscard]] std::shared_ptr<grpc::Channel> channel(const std::string& folder) const {
    return security::open_channel(Endpoint(node_->address(), folder, false));
  }
  static std::vector<std::string> paths() {
    return security::paths_of(*v1::PicturePlane_descriptor()->file());
  }

  security::TestAuthority authority_;
  std::unique_ptr<RenderNode> node_;
};

TEST_F(NodeRolesTest, EveryCallIsAllowedToExactlyTheRolesThatItsOptionNames) {
  ASSERT_EQ(paths().size(), 2U);
  for (const v1::Role role : security::kRoles) {
    const auto caller = channel(authority_.issue(security::to_string(role), {role}));
    for (const std::string& path : paths()) {
      const std::string call = "RenderService." + path.substr(path.rfind('/') + 1);
      const grpc::Status status = security::call(caller, path);
      const bool is_allowed = security::includes(role, security::role_needed(call));
      EXPECT_EQ(status.error_code() == grpc::StatusCode::PERMISSION_DENIED, !is_allowed)
          << path << " as " << security::to_string(role) << ": " << status.error_message();
      EXPECT_NE(status.error_code(), grpc::StatusCode::UNAUTHENTICATED) << path;
      EXPECT_NE(status.error_code(), grpc::StatusCode::UNAVAILABLE) << path;
    }
  }
}

TEST_F(NodeRolesTest, NobodyAndStrangersAreRefused) {
  const security::TestAuthority foreign;
  const auto nobody = channel(authority_.folder_of("painter"));
  const auto stranger = channel(foreign.issue("eve", {v1::ROLE_ADMIN}));
  const auto without = security::open_channel(Endpoint(node_->address()));
  for (const std::string& path : paths()) {
    EXPECT_EQ(security::call(nobody, path).error_code(), grpc::StatusCode::PERMISSION_DENIED);
    EXPECT_EQ(security::call(stranger, path).error_code(), grpc::StatusCode::UNAVAILABLE);
    EXPECT_EQ(security::call(without, path).error_code(), grpc::StatusCode::UNAVAILABLE);
  }
}

}  // namespace
}  // namespace weft::render
