#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli_programs.h"

// Completion as the shells themselves do it, where they are installed.

namespace weft::cli {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Not;
using testing::UnorderedElementsAre;

bool has(const std::string& shell) {
  return std::system(("command -v " + shell + " >/dev/null").c_str()) == 0;  // NOLINT
}

std::vector<std::string> lines_of(const std::vector<std::string>& command, const std::string& log) {
  ChildProcess process(command, log, true);
  std::vector<std::string> lines;
  while (const auto line = process.read_line(30)) {
    lines.push_back(*line);
  }
  EXPECT_EQ(process.wait(10), 0) << core::read_file(log);
  EXPECT_EQ(core::read_file(log), "");
  return lines;
}

class CompletionTest : public testing::Test {
 protected:
  void SetUp() override {
    core::write_file_atomically(folder_ / "mine.textproto", "");
    // Nothing listens on port 1: completion must not wait for it, nor speak of it.
    set("WEFT_COORDINATOR", "127.0.0.1:1");
    set("PATH", std::string(WEFT_BIN_DIR) + ":/usr/bin:/bin");
  }
  void TearDown() override { unsetenv("WEFT_COORDINATOR"); }  // NOLINT(concurrency-mt-unsafe)

  static void set(const char* name, const std::string& value) {
    setenv(name, value.c_str(), 1);  // NOLINT(concurrency-mt-unsafe)
  }

  std::string script(const std::string& shell) {
    const std::string path = folder_ / ("script." + shell);
    core::write_file_atomically(path, run_weft(folder_, {"completion", shell}).out);
    return path;
  }

  // What bash offers after `line` when Tab is pressed: it sets these variables for the function.
  std::vector<std::string> bash(const std::string& line, const std::string& last_word) {
    const std::string call =
        "cd " + folder_.path().string() + "; . " + script("bash") + "; COMP_LINE='" + line +
        "'; COMP_POINT=${#COMP_LINE}; COMP_WORDS=(weft x '" + last_word +
        "'); COMP_CWORD=2; _weft; for word in \"${COMPREPLY[@]}\"; do echo \"$word\"; done";
    return lines_of({"/bin/bash", "--norc", "-c", call}, folder_ / "bash.log");
  }

  std::vector<std::string> fish(const std::string& line) {
    return lines_of({"/usr/bin/env", "HOME=" + folder_.path().string(), "fish", "--no-config", "-c",
                     "cd " + folder_.path().string() + "; source " + script("fish") +
                         "; complete -C '" + line + "'"},
                    folder_ / "fish.log");
  }

  TestFolder folder_;
};

TEST_F(CompletionTest, BashOffersCommandsOptionsChoicesAndFiles) {
  EXPECT_THAT(bash("weft sub", "sub"), ElementsAre("submit"));
  EXPECT_THAT(bash("weft submit --pri", "--pri"), ElementsAre("--priority"));
  EXPECT_THAT(bash("weft submit --quality ", ""), ElementsAre("preview", "paper", "best"));
  EXPECT_THAT(bash("weft submit mi", "mi"), ElementsAre("mine.textproto"));
  EXPECT_THAT(bash("weft certs is", "is"), ElementsAre("issue"));
  EXPECT_THAT(bash("weft watch ", ""), ElementsAre());
  EXPECT_THAT(bash("weft-worker --thr", "--thr"), ElementsAre());  // COMP_WORDS says weft
}

TEST_F(CompletionTest, BashIsGivenNoMoreThanBehindWhereItBreaksWords) {
  EXPECT_THAT(bash("weft submit --quality=p", "p"), ElementsAre("preview", "paper"));
}

TEST_F(CompletionTest, BashLoadsItsScriptWithoutAComplaint) {
  EXPECT_THAT(lines_of({"/bin/bash", "-n", script("bash")}, folder_ / "n.log"), ElementsAre());
}

TEST_F(CompletionTest, FishOffersCommandsWithTheirMeaning) {
  if (!has("fish")) {
    GTEST_SKIP() << "fish is not installed";
  }
  EXPECT_THAT(fish("weft sub"),
              ElementsAre("submit\tQueue the precomputation of a fabric with a coordinator."));
  EXPECT_THAT(fish("weft submit --quality "), UnorderedElementsAre("preview", "paper", "best"));
  EXPECT_THAT(fish("weft-worker --thr"),
              ElementsAre(testing::StartsWith("--threads\tShards computed")));
  EXPECT_THAT(fish("weft submit mi"), Contains(testing::StartsWith("mine.textproto")));
}

TEST_F(CompletionTest, ZshParsesItsScriptAndOffersCommands) {
  if (!has("zsh")) {
    GTEST_SKIP() << "zsh is not installed";
  }
  const std::string path = script("zsh");
  EXPECT_THAT(lines_of({"/usr/bin/env", "zsh", "-n", path}, folder_ / "n.log"), ElementsAre());
  // What zle would set, and a _describe that prints instead of drawing a menu.
  const std::string call =
      "compdef() { }; _describe() { print -l -- ${(P)4} }; words=(weft submi); CURRENT=2; "
      "PREFIX=submi; . " +
      path + "; _weft";
  EXPECT_THAT(lines_of({"/usr/bin/env", "zsh", "-f", "-c", call}, folder_ / "zsh.log"),
              ElementsAre("submit:Queue the precomputation of a fabric with a coordinator."));
}

TEST_F(CompletionTest, NamesComeFromTheCoordinator) {
  const TestCluster cluster(folder_, "names", 1);
  set("WEFT_COORDINATOR", cluster.address());
  set("WEFT_COMPLETION_MS", "30000");  // however busy this machine is
  const std::string fabric = std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto";
  ASSERT_EQ(run_weft(folder_, {"submit", fabric, "--quality", "preview", "--wait"}).code, 0);
  const Finished job = run_weft(folder_, {"jobs", "--json"});
  const auto id = job.json().at(0).at("id").get<std::string>();
  EXPECT_THAT(bash("weft watch ", ""), ElementsAre(id));
  EXPECT_THAT(bash("weft drain ", ""), ElementsAre("names-worker-0"));
  EXPECT_THAT(bash("weft versions ", ""), ElementsAre("tiny"));
  EXPECT_THAT(bash("weft fetch tiny@", "@"), ElementsAre("1"));
  EXPECT_THAT(bash("weft explain worker ", ""), ElementsAre("names-worker-0"));
  EXPECT_THAT(bash("weft render ti", "ti"), ElementsAre("tiny"));
}

}  // namespace
}  // namespace weft::cli
