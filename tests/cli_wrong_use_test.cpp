#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli_programs.h"

// Every command used wrongly once: the exit code, a message on stderr, nothing on stdout.

namespace weft::cli {
namespace {

struct WrongUse {
  std::vector<std::string> arguments;
  int code;
  std::string message;  // a part of it
};

void expect_refused(const std::vector<WrongUse>& uses) {
  const TestFolder folder;
  for (const WrongUse& use : uses) {
    const Finished finished = run_weft(folder, use.arguments);
    const std::string command = testing::PrintToString(use.arguments);
    EXPECT_EQ(finished.code, use.code) << command << finished.err;
    EXPECT_NE(finished.err.find(use.message), std::string::npos) << command << finished.err;
    EXPECT_EQ(finished.out, "") << command;
  }
}

// Nothing listens on port 1.
const std::vector<std::string> kNowhere{"--coordinator", "127.0.0.1:1"};

std::vector<std::string> nowhere(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), kNowhere.begin(), kNowhere.end());
  return arguments;
}

TEST(WrongUse, WithoutACoordinatorEveryCommandExitsWithFiveAndSaysHowToStartOne) {
  const std::string tiny = std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto";
  expect_refused({{nowhere({"jobs"}), 5, "weft up"},
                  {nowhere({"jobs", "--json"}), 5, "weft up"},
                  {nowhere({"workers"}), 5, "weft up"},
                  {nowhere({"fabrics"}), 5, "weft up"},
                  {nowhere({"versions", "silk"}), 5, "weft up"},
                  {nowhere({"fetch", "silk"}), 5, "weft up"},
                  {nowhere({"log", "silk"}), 5, "weft up"},
                  {nowhere({"diff", "silk@1", "silk@2"}), 5, "weft up"},
                  {nowhere({"tag", "silk@1", "good"}), 5, "weft up"},
                  {nowhere({"untag", "silk:good"}), 5, "weft up"},
                  {nowhere({"rollback", "silk@1"}), 5, "weft up"},
                  {nowhere({"gc"}), 5, "weft up"},
                  {nowhere({"watch", "j0"}), 5, "weft up"},
                  {nowhere({"cancel", "j0"}), 5, "weft up"},
                  {nowhere({"submit", tiny}), 5, "weft up"}});
}

TEST(WrongUse, ACommandLineThatIsWrongExitsWithTwo) {
  expect_refused(
      {{{"run"}, 2, "fabric is required"},
       {{"run", "x.textproto", "-o", "x.h5", "--threads", "0"}, 2, "--threads"},
       {{"run", "x.textproto", "-o", "x.h5", "--quality", "good"}, 2, "--quality"},
       {{"up", "--workers", "0"}, 2, "--workers"},
       {{"submit"}, 2, "fabric is required"},
       {{"submit", "x.textproto", "-o", "x.h5"}, 2, "--wait"},
       {{"jobs", "--limit", "0"}, 2, "--limit"},
       {{"jobs", "--coordinator", "nowhere"}, 2, "host:port"},
       {{"jobs", "--coordinator", "127.0.0.1:99999"}, 2, "host:port"},
       {{"watch"}, 2, "job is required"},
       {{"cancel"}, 2, "job is required"},
       {{"workers", "--frob"}, 2, "--frob"},
       {{"fabrics", "silk"}, 2, "silk"},
       {{"versions"}, 2, "fabric is required"},
       {{"fetch", "Silk@3"}, 2, "NAME@NUMBER"},
       {{"render", "-o", "x.exr"}, 2, "fabric is required"},
       {{"render", "silk", "-o", "x.exr", "--layers", "shade"}, 2, "single,multiple"},
       {{"render", "silk", "-o", "x.exr", "--node", "nowhere"}, 2, "host:port"},
       {{"render", "silk", "-o", "x.exr", "--node", "127.0.0.1:1", "--resume"}, 2, "--resume"},
       {{"render", "--again", "a.exr", "--scene", "b", "-o", "x.exr"}, 2, "--scene"}});
}

TEST(WrongUse, FilesThatAreNotThereOrCannotBeWrittenAreNamed) {
  const std::string tiny = std::string(WEFT_SOURCE_DIR) + "/examples/tiny.textproto";
  expect_refused({{{"run", "no_such.textproto", "-o", "x.h5"}, 3, "no_such.textproto"},
                  {{"submit", "no_such.textproto"}, 3, "no_such.textproto"},
                  {{"run", tiny}, 2, "--output"},
                  {{"run", tiny, "-o", "/no/such/folder/x.h5"}, 3, "/no/such/folder"},
                  {{"run", tiny, "-o", "/tmp"}, 1, "is a folder"},
                  {{"run", tiny, "-o", "/proc/x.h5"}, 5, "/proc"}});
}

TEST(WrongUse, ARenderNodeThatIsNotThereOrCannotDrawAFileIsToldApart) {
  expect_refused({{{"render", "silk", "-o", "x.exr", "--node", "127.0.0.1:1"}, 5, "weft-render"},
                  {{"render", "./silk.h5", "-o", "x.exr", "--node", "127.0.0.1:1"}, 1, "published"},
                  {{"render", "--again", "no_such.exr", "-o", "x.exr"}, 3, "no_such.exr"}});
}

TEST(WrongUse, APictureThatWouldHaveAnotherFormatsNameIsRefused) {
  expect_refused({{{"render", "silk.h5", "-o", "x.png"}, 2, "name it .exr"}});
}

TEST(WrongUse, AnUnknownNameExitsWithThreeAndSaysWhatThereIs) {
  const TestFolder folder;
  const TestCluster cluster(folder, "names", 0);
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"versions", "silk"},
                                             {"fetch", "silk"},
                                             {"fetch", "silk@3"},
                                             {"watch", "j123"},
                                             {"cancel", "j123"}}) {
    const Finished finished = cluster.weft(arguments);
    EXPECT_EQ(finished.code, 3) << testing::PrintToString(arguments) << finished.err;
    EXPECT_NE(finished.err, "");
  }
}

TEST(WrongUse, AnEmptyCoordinatorAnswersEveryListWithOneJsonValue) {
  const TestFolder folder;
  const TestCluster cluster(folder, "empty", 0);
  for (const char* command : {"jobs", "workers", "fabrics"}) {
    const Finished finished = cluster.weft({command, "--json"});
    EXPECT_EQ(finished.code, 0) << finished.err;
    EXPECT_EQ(finished.json(), nlohmann::json::array());
  }
}

TEST(WrongUse, AWorkerRefusesNonsense) {
  const TestFolder folder;
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--threads", "0"},
                                             {"--threads", "x"},
                                             {"--coordinator", "nowhere"},
                                             {"--name", ""},
                                             {"--scratch-limit", "1"},
                                             {"--frob"},
                                             {"stray"}}) {
    std::vector<std::string> command{program("weft-worker")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    ChildProcess process(command, folder / "worker.err", false);
    EXPECT_EQ(process.wait(10), 2) << testing::PrintToString(arguments);
  }
}

TEST(WrongUse, ADryRunPrintsOneJsonValueAndWritesNothing) {
  const TestFolder folder;
  const std::string fabric = write_description(folder, "512");
  const Finished finished = run_weft(folder, {"run", fabric, "--dry-run", "--json"});
  ASSERT_EQ(finished.code, 0) << finished.err;
  EXPECT_EQ(finished.json().at("fibres"), 96);
  EXPECT_GT(finished.json().at("segments"), 0);
  const Finished submitted = run_weft(folder, {"submit", fabric, "--dry-run", "--json"});
  EXPECT_EQ(submitted.out, finished.out);
}

}  // namespace
}  // namespace weft::cli
