#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/digest.h"
#include "core/error.h"
#include "core/file.h"
#include "tests/cli_answer_dropper.h"
#include "tests/cli_fault_cluster.h"

// Real processes that are killed, stopped, starved of disk and robbed of answers: the database is
// always that of an undisturbed run, and nothing is computed but in an attempt that is recorded.
// WEFT_LONG=1 kills 2,000 times in place of 20.

namespace weft::cli {
namespace {

constexpr const char* kPathsPerCell = "16384";

class Faults : public testing::Test {
 protected:
  // What `weft run` gives, once for all tests.
  static const std::string& expected() {
    static const std::string kDigest = [] {
      const TestFolder folder;
      const Finished run = run_weft(folder, {"run", write_description(folder, kPathsPerCell), "-o",
                                             folder / "run.h5", "--json"});
      EXPECT_EQ(run.code, 0) << run.err;
      return run.json().at("content_digest").get<std::string>();
    }();
    return kDigest;
  }
  void SetUp() override {
    ASSERT_FALSE(expected().empty());
    description_ = write_description(folder_, kPathsPerCell);
  }

  static std::string hex_of(const std::string& bytes) {
    return core::Digest::from_binary(bytes).value_or(core::Digest()).hex();
  }
  static void expect_success(const v1::Job& job) {
    ASSERT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.ShortDebugString();
    EXPECT_EQ(hex_of(job.version().content_digest()), expected());
    for (const v1::Trouble& trouble : job.troubles()) {
      ADD_FAILURE() << trouble.ShortDebugString();
    }
  }
  // Each shard no more often than there are attempts that held it; checks that all were computed.
  static void expect_no_more_than_attempts(FaultCluster& cluster, const v1::Job& job) {
    std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> held;
    for (const v1::AttemptInfo& attempt : cluster.attempts()) {
      for (std::uint64_t i = 0; i < attempt.shards(); ++i) {
        ++held[{attempt.stage(), attempt.first_shard() + i}];
      }
    }
    const auto computed = cluster.computed();
    for (const auto& [shard, times] : computed) {
      EXPECT_LE(times, held[shard]) << shard.first << "/" << shard.second;
    }
    EXPECT_EQ(computed.size(), FaultCluster::shards_done(job));
  }
  static void expect_nothing_lost_or_computed_again(FaultCluster& cluster) {
    std::map<std::pair<std::string, std::uint64_t>, std::uint64_t> allowed;
    for (const v1::AttemptInfo& attempt : cluster.attempts()) {
      EXPECT_NE(attempt.outcome(), "lost") << attempt.ShortDebugString();
      EXPECT_EQ(attempt.taken_up(), 0U) << attempt.ShortDebugString();
      // On a busy machine a run may be so slow that an idle worker is given it, too.
      for (std::uint64_t i = 0; attempt.purpose() == "speculation" && i < attempt.shards(); ++i) {
        ++allowed[{attempt.stage(), attempt.first_shard() + i}];
      }
    }
    for (const auto& [shard, times] : cluster.computed()) {
      EXPECT_LE(times, 1 + allowed[shard]) << shard.first << "/" << shard.second;
    }
  }
  static void pause(int ms) { std::this_thread::sleep_for(std::chrono::milliseconds(ms)); }

  TestFolder folder_;
  std::string description_;
};

// A job under up to `kills` SIGKILLs at random moments, of which each comes after some progress:
// the rule that a task is a killer when its worker dies five times in a row is not what is tested.
int run_under_kills(FaultCluster& cluster, unsigned seed, int kills) {
  std::mt19937 random(seed);
  int done = 0;
  std::uint64_t shards = 0;
  while (done < kills) {
    std::this_thread::sleep_for(
        std::chrono::milliseconds(std::uniform_int_distribution<int>(0, 400)(random)));
    const v1::Job job = cluster.wait_until(
        [&](const v1::Job& now) { return FaultCluster::shards_done(now) > shards; });
    if (job.ended_at_ms() != 0) {
      break;
    }
    shards = FaultCluster::shards_done(job);
    const unsigned victim = std::uniform_int_distribution<unsigned>(0, 2)(random);
    if (victim == 2) {
      cluster.coordinator().signal(SIGKILL);
      EXPECT_EQ(cluster.coordinator().wait(20), 128 + SIGKILL);
      cluster.start_coordinator();
    } else {
      cluster.worker(victim).signal(SIGKILL);
      EXPECT_EQ(cluster.worker(victim).wait(20), 128 + SIGKILL);
      cluster.start_worker(victim);
    }
    ++done;
  }
  return done;
}

TEST_F(Faults, KillsAtRandomMomentsChangeNothing) {
  const char* const is_long = std::getenv("WEFT_LONG");  // NOLINT(concurrency-mt-unsafe)
  const int wanted = is_long != nullptr && std::string(is_long) == "1" ? 2000 : 20;
  int kills = 0;
  for (unsigned round = 1; kills < wanted; ++round) {
    SCOPED_TRACE("seed " + std::to_string(round));
    FaultCluster cluster(folder_.path() / ("kills-" + std::to_string(round)), 2, "3");
    cluster.start_worker(0);
    cluster.start_worker(1);
    cluster.submit(folder_, description_);
    const int more = run_under_kills(cluster, round, std::min(20, wanted - kills));
    const v1::Job job = cluster.wait_for_end();
    expect_success(job);
    expect_no_more_than_attempts(cluster, job);
    ASSERT_GT(more, 0) << "the job was over before anybody was killed";
    kills += more;
    std::uint64_t times = 0;
    for (const auto& [shard, often] : cluster.computed()) {
      times += often;
    }
    std::printf("seed %u: %d kills, %zu attempts, %llu shards, computed %llu times\n", round, more,
                cluster.attempts().size(),
                static_cast<unsigned long long>(FaultCluster::shards_done(job)),
                static_cast<unsigned long long>(times));
    std::fflush(stdout);
    if (HasFailure()) {
      return;
    }
  }
}

TEST_F(Faults, AWorkerThatIsStoppedForLongerThanItsLeaseDoesNoHarm) {
  FaultCluster cluster(folder_.path() / "stopped", 2, "2");
  cluster.start_worker(0);
  cluster.start_worker(1);
  cluster.submit(folder_, description_);
  ASSERT_EQ(cluster.wait_for_transfer().ended_at_ms(), 0);
  cluster.worker(0).signal(SIGSTOP);
  pause(5000);
  cluster.worker(0).signal(SIGCONT);
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  EXPECT_FALSE(cluster.worker(0).exit_code()) << "it goes on as if nothing had been";
  bool was_lost = false;
  for (const v1::AttemptInfo& attempt : cluster.attempts()) {
    was_lost = was_lost || attempt.outcome() == "lost" || attempt.earlier_outcome() == "lost";
    EXPECT_EQ(attempt.taken_up() > 0, attempt.earlier_ended_at_ms() > 0);
    EXPECT_LE(attempt.earlier_ended_at_ms(), attempt.taken_up_at_ms());
  }
  EXPECT_TRUE(was_lost) << "its lease never ended, or the history has forgotten it";
}

TEST_F(Faults, WhileTheCoordinatorIsAwayWorkersGoOnAndNothingIsDoneAgain) {
  FaultCluster cluster(folder_.path() / "away", 2, "9");
  cluster.start_worker(0);
  cluster.start_worker(1);
  cluster.submit(folder_, description_);
  ASSERT_EQ(cluster.wait_for_transfer().ended_at_ms(), 0);
  cluster.coordinator().signal(SIGKILL);
  EXPECT_EQ(cluster.coordinator().wait(20), 128 + SIGKILL);
  pause(6000);  // two thirds of a lease, as twenty seconds are of the usual one
  cluster.start_coordinator();
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  expect_nothing_lost_or_computed_again(cluster);
  if (HasFailure()) {
    cluster.tell_all();
  }
  const Finished logs = run_weft(
      folder_, {"logs", job.id(), "--task", "transfer", "--coordinator", cluster.address()});
  EXPECT_EQ(logs.code, 0) << logs.err;
  EXPECT_NE(logs.out.find("begins on worker-0"), std::string::npos) << logs.out;
  EXPECT_NE(logs.out.find("computed in"), std::string::npos) << logs.out;
}

TEST_F(Faults, AWorkerWhoseResultsWereOnlyOnItsDiskReportsThemAfterItsRestart) {
  FaultCluster cluster(folder_.path() / "spool", 1, "3");
  cluster.start_worker(0);
  cluster.submit(folder_, description_);
  ASSERT_EQ(cluster.wait_for_transfer().ended_at_ms(), 0);
  cluster.coordinator().signal(SIGKILL);
  EXPECT_EQ(cluster.coordinator().wait(20), 128 + SIGKILL);
  pause(2000);  // what it computes now has nowhere to go
  cluster.worker(0).signal(SIGKILL);
  EXPECT_EQ(cluster.worker(0).wait(20), 128 + SIGKILL);
  cluster.start_coordinator();
  cluster.start_worker(0);
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  EXPECT_NE(cluster.worker_log(0).find("state=taken_over"), std::string::npos);
  std::uint64_t again = 0;
  for (const auto& [shard, times] : cluster.computed()) {
    again += times - 1;
  }
  EXPECT_LE(again, 1U) << "only what was in hand when it was killed is lost";
}

// No process may write beyond this in a file: as if the disk were full, without a disk of one's
// own.
void limit_files(const ChildProcess& process, rlim_t bytes) {
  rlimit limit{};
  ASSERT_EQ(prlimit(process.pid(), RLIMIT_FSIZE, nullptr, &limit), 0);
  limit.rlim_cur = std::min(bytes, limit.rlim_max);
  ASSERT_EQ(prlimit(process.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
}

TEST_F(Faults, AWorkerWithAFullDiskIsShortOfAResourceUntilThereIsRoom) {
  FaultCluster cluster(folder_.path() / "full", 1, "3");
  cluster.start_worker(0);
  cluster.submit(folder_, description_);
  const v1::Job before = cluster.wait_for_transfer();
  ASSERT_EQ(before.ended_at_ms(), 0);
  limit_files(cluster.worker(0), 1000);
  pause(3000);
  ASSERT_FALSE(cluster.worker(0).exit_code()) << cluster.worker_log(0);
  const v1::Job meanwhile = cluster.wait_until([](const v1::Job&) { return true; });
  EXPECT_EQ(meanwhile.ended_at_ms(), 0);
  limit_files(cluster.worker(0), RLIM_INFINITY);
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  EXPECT_GE(FaultCluster::shards_done(meanwhile), FaultCluster::shards_done(before))
      << "what was reported is kept";
  bool was_short = false;
  for (const v1::AttemptInfo& attempt : cluster.attempts()) {
    was_short = was_short || attempt.message().find("--scratch") != std::string::npos;
    EXPECT_NE(attempt.outcome(), "lost") << attempt.ShortDebugString();
  }
  EXPECT_TRUE(was_short) << "no attempt says that the disk was full";
}

TEST_F(Faults, ACoordinatorWithAFullDiskStopsAndGoesOnWhenThereIsRoom) {
  FaultCluster cluster(folder_.path() / "full-journal", 2, "9");
  cluster.start_worker(0);
  cluster.start_worker(1);
  const std::string id = cluster.submit(folder_, description_);
  ASSERT_EQ(cluster.wait_for_transfer().ended_at_ms(), 0);
  limit_files(cluster.coordinator(), 1000);
  // Workers keep what it cannot store and report nothing more; an order is written to the journal.
  const Finished order =
      run_weft(folder_, {"priority", id, "1", "--coordinator", cluster.address()});
  EXPECT_EQ(order.code, 5) << order.out << order.err;
  const auto code = cluster.coordinator().wait(60);
  ASSERT_TRUE(code) << "it goes on though its journal cannot be written";
  EXPECT_EQ(*code, 1);
  pause(2000);  // what is computed now stays with the workers
  cluster.start_coordinator();
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  expect_nothing_lost_or_computed_again(cluster);
  if (HasFailure()) {
    cluster.tell_all();
  }
}

// Where blobs would go stand files, so that no new result can be stored while the journal is well.
class NoRoomForBlobs {
 public:
  explicit NoRoomForBlobs(std::filesystem::path blobs) : blobs_(std::move(blobs)) {
    for (int i = 0; i < 256; ++i) {
      const std::filesystem::path folder = blobs_ / fmt::format("{:02x}", i);
      if (std::filesystem::exists(folder)) {
        continue;
      }
      try {
        core::write_file_atomically(folder, "");
        in_the_way_.push_back(folder);
      } catch (const core::Error&) {
        EXPECT_TRUE(std::filesystem::is_directory(folder));  // the coordinator has just made it
      }
    }
  }
  void clear() {
    for (const std::filesystem::path& file : in_the_way_) {
      std::filesystem::remove(file);
    }
    in_the_way_.clear();
  }

 private:
  std::filesystem::path blobs_;
  std::vector<std::filesystem::path> in_the_way_;
};

TEST_F(Faults, WhatTheCoordinatorHasNoRoomForIsDeliveredWhenThereIs) {
  FaultCluster cluster(folder_.path() / "full-blobs", 2, "9");
  cluster.start_worker(0);
  cluster.start_worker(1);
  cluster.submit(folder_, description_);
  ASSERT_EQ(cluster.wait_for_transfer().ended_at_ms(), 0);
  NoRoomForBlobs full(cluster.path("state/blobs"));
  const auto waits = [&](std::size_t worker) {
    return cluster.worker_log(worker).find("event=cannot_deliver") != std::string::npos;
  };
  for (int i = 0; i < 600 && !(waits(0) && waits(1)); ++i) {
    pause(100);
  }
  EXPECT_TRUE(waits(0) && waits(1));
  const Finished workers =
      run_weft(folder_, {"workers", "--json", "--coordinator", cluster.address()});
  ASSERT_EQ(workers.code, 0) << workers.err;
  for (const auto& worker : workers.json()) {
    EXPECT_NE(worker.at("undelivered").get<std::string>().find("cannot store"), std::string::npos)
        << worker;
  }
  pause(3000);
  full.clear();
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  expect_nothing_lost_or_computed_again(cluster);
  for (const v1::AttemptInfo& attempt : cluster.attempts()) {
    EXPECT_NE(attempt.outcome(), "failed") << attempt.ShortDebugString();
  }
  if (HasFailure()) {
    cluster.tell_all();
  }
}

TEST_F(Faults, AnswersThatAreLostChangeNothing) {
  FaultCluster cluster(folder_.path() / "answers", 2, "6");
  AnswerDropper proxy(cluster.address(), 7, 12);
  cluster.start_worker(0, proxy.address());
  cluster.start_worker(1, proxy.address());
  cluster.submit(folder_, description_);
  const v1::Job job = cluster.wait_for_end();
  expect_success(job);
  expect_no_more_than_attempts(cluster, job);
  EXPECT_GE(proxy.dropped(), 5);
}

}  // namespace
}  // namespace weft::cli
