#include <csignal>
#include <string>

#include <gtest/gtest.h>

#include "tests/cli_programs.h"

// Ctrl-C, as a terminal sends it, while a job is followed. No worker is there: jobs wait.

namespace weft::cli {
namespace {

// A `weft` that is under way, and what it has said so far.
class Following {
 public:
  Following(const TestFolder& folder, std::vector<std::string> arguments)
      : log_(folder / "following.log") {
    arguments.insert(arguments.begin(), program("weft"));
    process_ = std::make_unique<ChildProcess>(arguments, log_, false);
  }

  void signal(int number) { process_->signal(number); }
  [[nodiscard]] std::optional<int> wait() { return process_->wait(30); }
  [[nodiscard]] std::string said() const { return core::read_file(log_); }
  // Waits until it has said this.
  [[nodiscard]] bool says(const std::string& text) {
    for (int i = 0; i < 200; ++i) {
      if (said().find(text) != std::string::npos) {
        return true;
      }
      if (process_->wait(0.1)) {
        return said().find(text) != std::string::npos;
      }
    }
    return false;
  }

 private:
  std::string log_;
  std::unique_ptr<ChildProcess> process_;
};

class InterruptionTest : public testing::Test {
 protected:
  std::vector<std::string> submit() {
    return {"submit", std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto", "--wait",
            "--coordinator", cluster_.address()};
  }
  [[nodiscard]] nlohmann::json job() { return cluster_.weft({"jobs", "--json"}).json().at(0); }

  TestFolder folder_;
  TestCluster cluster_{folder_, "interrupted", 0};
};

TEST_F(InterruptionTest, TheFirstLeavesTheJobAndSaysHowToComeBack) {
  Following following(folder_, submit());
  ASSERT_TRUE(following.says("waiting for")) << following.said();
  following.signal(SIGINT);
  EXPECT_EQ(following.wait(), 1);
  const auto id = job().at("id").get<std::string>();
  EXPECT_EQ(job().at("state"), "queued");
  EXPECT_NE(following.said().find("'weft watch " + id + "' comes back to it; Ctrl-C again"),
            std::string::npos)
      << following.said();
}

TEST_F(InterruptionTest, TheSecondCancelsTheJob) {
  Following following(folder_, submit());
  ASSERT_TRUE(following.says("waiting for")) << following.said();
  following.signal(SIGINT);
  ASSERT_TRUE(following.says("Ctrl-C again cancels it")) << following.said();
  following.signal(SIGINT);
  EXPECT_EQ(following.wait(), 1);
  EXPECT_EQ(job().at("state"), "cancelled");
  EXPECT_NE(following.said().find("weft retry"), std::string::npos) << following.said();
}

TEST_F(InterruptionTest, WatchIsLeftAtOnceWhenItIsAskedToEnd) {
  ASSERT_EQ(
      cluster_.weft({"submit", std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto"}).code, 0);
  const auto id = job().at("id").get<std::string>();
  Following following(folder_, {"watch", id, "--coordinator", cluster_.address()});
  ASSERT_TRUE(following.says("waiting for")) << following.said();
  following.signal(SIGTERM);
  EXPECT_EQ(following.wait(), 1);
  EXPECT_EQ(following.said().find("Ctrl-C again"), std::string::npos) << following.said();
  EXPECT_EQ(job().at("state"), "queued");
}

TEST_F(InterruptionTest, WatchGoesOnWhileTheCoordinatorIsAwayAndIsLeftAllTheSame) {
  ASSERT_EQ(
      cluster_.weft({"submit", std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto"}).code, 0);
  const auto id = job().at("id").get<std::string>();
  Following following(folder_, {"watch", id, "--coordinator", cluster_.address()});
  ASSERT_TRUE(following.says("waiting for")) << following.said();
  cluster_.coordinator().signal(SIGKILL);
  ASSERT_TRUE(following.says("the coordinator is away")) << following.said();
  following.signal(SIGTERM);
  EXPECT_EQ(following.wait(), 1);
}

}  // namespace
}  // namespace weft::cli
