#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "core/clock.h"
#include "tests/cli_programs.h"

// The same fabric precomputed in one process and in clusters of real processes, through the same
// commands that people use.

namespace weft::cli {
namespace {

constexpr double kDeadlineSeconds = 60;

std::string content_digest(const TestFolder& folder, const std::string& path) {
  const Finished inspected = run_weft(folder, {"inspect", path, "--json"});
  EXPECT_EQ(inspected.code, 0) << inspected.err;
  return inspected.code == 0 ? inspected.json().at("content_digest").get<std::string>() : "";
}

// What the worker named `name` runs now.
nlohmann::json attempts_of(const TestCluster& cluster, const std::string& name) {
  const Finished listed = cluster.weft({"workers", "--json"});
  EXPECT_EQ(listed.code, 0) << listed.err;
  for (const nlohmann::json& worker : listed.json()) {
    if (worker.at("name") == name) {
      return worker.at("attempts");
    }
  }
  return nlohmann::json::array();
}

// Stops the worker at a moment when it holds an attempt of the transfer stage, then kills it.
// Stopped first: what it holds then cannot be reported any more.
bool kill_in_mid_attempt(TestCluster& cluster, std::size_t index, const std::string& name) {
  const core::Stopwatch since_start;
  while (since_start.seconds() < kDeadlineSeconds) {
    cluster.worker(index).signal(SIGSTOP);
    for (const nlohmann::json& attempt : attempts_of(cluster, name)) {
      if (attempt.at("stage") == "transfer") {
        cluster.worker(index).signal(SIGKILL);
        return true;
      }
    }
    cluster.worker(index).signal(SIGCONT);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
  }
  return false;
}

TEST(Cluster, OneProcessOneWorkerAndTwoWorkersOfWhichOneIsKilledGiveTheSameDatabase) {
  const TestFolder folder;
  const std::string fabric = write_description(folder, "60000");

  const Finished run = run_weft(folder, {"run", fabric, "-o", folder / "run.h5", "--json"});
  ASSERT_EQ(run.code, 0) << run.err;
  const std::string expected = content_digest(folder, folder / "run.h5");
  EXPECT_EQ(run.json().at("content_digest"), expected);
  EXPECT_FALSE(std::filesystem::exists(folder / "run.h5.weft")) << "what was kept to go on with";

  {
    const TestCluster one(folder, "one", 1);
    const Finished submitted =
        one.weft({"submit", fabric, "--wait", "-o", folder / "one.h5", "--json"});
    ASSERT_EQ(submitted.code, 0) << submitted.err;
    EXPECT_EQ(submitted.json().at("version").at("content_digest"), expected);
    EXPECT_EQ(content_digest(folder, folder / "one.h5"), expected);
  }

  TestCluster two(folder, "two", 2);
  const Finished submitted = two.weft({"submit", fabric, "--json"});
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  const std::string job = submitted.json().at("id");
  ASSERT_TRUE(kill_in_mid_attempt(two, 0, "two-worker-0")) << submitted.err;
  const Finished watched = two.weft({"watch", job, "--json"});
  ASSERT_EQ(watched.code, 0) << watched.err;
  EXPECT_EQ(watched.json().at("version").at("content_digest"), expected);
  EXPECT_EQ(two.worker(0).wait(5), 128 + SIGKILL);
  const Finished fetched = two.weft({"fetch", "tiny", "-o", folder / "two.h5", "--json"});
  ASSERT_EQ(fetched.code, 0) << fetched.err;
  EXPECT_EQ(content_digest(folder, folder / "two.h5"), expected);
  EXPECT_EQ(core::read_file(folder / "two.h5"), core::read_file(folder / "run.h5"));
}

TEST(Cluster, ARunThatWasInterruptedGoesOnWhereItWas) {
  const TestFolder folder;
  const std::string fabric = write_description(folder, "60000");
  const std::string output = folder / "out.h5";
  {
    ChildProcess process({program("weft"), "run", fabric, "-o", output, "--threads", "1"},
                         folder / "run.err", false);
    const core::Stopwatch since_start;
    while (since_start.seconds() < kDeadlineSeconds &&
           core::read_file(folder / "run.err").find("grid: 1 done") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    process.signal(SIGINT);
    EXPECT_EQ(process.wait(kDeadlineSeconds), 1) << core::read_file(folder / "run.err");
  }
  EXPECT_NE(core::read_file(folder / "run.err").find("run the same command again"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(output));
  const Finished again = run_weft(folder, {"run", fabric, "-o", output, "--json"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(again.json().at("stages").at(0).at("cached"), 1);
  EXPECT_EQ(again.json().at("stages").at(1).at("cached"), 1);

  const Finished afresh = run_weft(folder, {"run", fabric, "-o", folder / "afresh.h5", "--json"});
  ASSERT_EQ(afresh.code, 0) << afresh.err;
  EXPECT_EQ(afresh.json().at("content_digest"), again.json().at("content_digest"));
}

TEST(Cluster, AWorkerThatIsAskedToEndReportsAndEndsWithZero) {
  const TestFolder folder;
  const std::string fabric = write_description(folder, "60000");
  TestCluster cluster(folder, "drain", 2);
  const Finished submitted = cluster.weft({"submit", fabric, "--json"});
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  cluster.worker(0).signal(SIGTERM);
  EXPECT_EQ(cluster.worker(0).wait(20), 0);
  const std::string log = core::read_file(folder / "drain-worker-0.log");
  EXPECT_NE(log.find("unacknowledged=0 state=ended"), std::string::npos) << log;
  const std::string job = submitted.json().at("id");
  EXPECT_EQ(cluster.weft({"watch", job}).code, 0);
}

TEST(Cluster, WorkersOutliveTheirCoordinatorAndGoOnWithItsSuccessor) {
  const TestFolder folder;
  const std::string fabric = write_description(folder, "60000");
  const std::string state = folder / "state";
  const std::string log = folder / "coordinator.log";
  const auto command = [&](const std::string& listen) {
    return std::vector<std::string>{
        program("weft-coordinator"), "--listen", listen, "--state", state, "--lease", "3"};
  };
  auto coordinator = std::make_unique<ChildProcess>(command("127.0.0.1:0"), log, true);
  const std::string line = coordinator->read_line(20).value_or("");
  ASSERT_NE(line.rfind(' '), std::string::npos);
  const std::string address = line.substr(line.rfind(' ') + 1);
  ChildProcess worker({program("weft-worker"), "--coordinator", address, "--threads", "1",
                       "--scratch", folder / "scratch"},
                      folder / "worker.log", false);
  const Finished submitted =
      run_weft(folder, {"submit", fabric, "--json", "--coordinator", address});
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  coordinator->signal(SIGKILL);
  ASSERT_EQ(coordinator->wait(10), 128 + SIGKILL);
  coordinator = std::make_unique<ChildProcess>(command(address), log, true);
  ASSERT_TRUE(coordinator->read_line(20)) << core::read_file(log);
  const std::string job = submitted.json().at("id");
  const Finished watched = run_weft(folder, {"watch", job, "--json", "--coordinator", address});
  EXPECT_EQ(watched.code, 0) << watched.err;
  EXPECT_FALSE(worker.exit_code()) << core::read_file(folder / "worker.log");
}

TEST(Cluster, UpStartsAllSaysWhereAndStopsAll) {
  const TestFolder folder;
  ChildProcess up({program("weft"), "up", "--workers", "2", "--state", folder / "state", "--listen",
                   "127.0.0.1:0", "--json"},
                  folder / "up.err", true);
  std::string text;
  while (!nlohmann::json::accept(text)) {
    const auto line = up.read_line(30);
    ASSERT_TRUE(line) << text << core::read_file(folder / "up.err");
    text += *line + "\n";
  }
  const nlohmann::json json = nlohmann::json::parse(text);
  const std::string address = json.at("coordinator");
  ASSERT_EQ(json.at("workers").size(), 2U);
  EXPECT_TRUE(json.at("page").get<std::string>().starts_with("http://127.0.0.1:")) << text;

  const Finished taken =
      run_weft(folder, {"up", "--state", folder / "other-state", "--listen", address});
  EXPECT_EQ(taken.code, 5) << taken.err;
  EXPECT_NE(taken.err.find("--listen"), std::string::npos) << taken.err;

  const Finished listed = run_weft(folder, {"workers", "--json", "--coordinator", address});
  ASSERT_EQ(listed.code, 0) << listed.err;
  EXPECT_EQ(listed.json().size(), 2U);

  up.signal(SIGTERM);
  EXPECT_EQ(up.wait(40), 0) << core::read_file(folder / "up.err");
  EXPECT_NE(kill(json.at("pid").get<pid_t>(), 0), 0) << "the coordinator still runs";
  for (const nlohmann::json& worker : json.at("workers")) {
    EXPECT_NE(kill(worker.at("pid").get<pid_t>(), 0), 0) << "a worker still runs";
  }
}

}  // namespace
}  // namespace weft::cli
