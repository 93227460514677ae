#include <gtest/gtest.h>

#include "tests/queue_cluster.h"

// Failures, back-off, run sizes and restarts.

namespace weft::coordinator {
namespace {

std::string name_of(int worker) { return std::string("w").append(std::to_string(worker)); }

TEST(QueueFaults, FailedShard_IsTriedAgainAfterABackOff) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {1});
  worker.sync(1);
  worker.fail("it burns");
  worker.sync(1);
  EXPECT_TRUE(worker.held.empty());
  cluster.advance(1'001);
  worker.sync(1);
  EXPECT_EQ(worker.held.size(), 1U);
}

TEST(QueueFaults, FiveFailures_EndTheJobWhichSaysWhy) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {1});
  for (int i = 0; i < 5; ++i) {
    cluster.advance(25'000);
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U) << i;
    worker.fail(std::string("fault number ").append(std::to_string(i)));
    worker.sync();
    EXPECT_EQ(cluster.job("a").has_ended(), i == 4) << i;
  }
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kFailed);
  const std::string& error = cluster.job("a").error;
  EXPECT_NE(error.find("geometry shard 0"), std::string::npos) << error;
  EXPECT_NE(error.find("fault number 4"), std::string::npos) << error;
}

TEST(QueueFaults, TheSameErrorOnThreeWorkers_EndsTheJob) {
  QueueCluster cluster;
  std::vector<QueueWorker> workers;
  for (const char* id : {"w1", "w2", "w3"}) {
    workers.emplace_back(cluster, id, 1);
  }
  for (QueueWorker& worker : workers) {
    worker.sync();
  }
  cluster.submit("a", {1});
  for (QueueWorker& worker : workers) {
    EXPECT_FALSE(cluster.job("a").has_ended());
    for (QueueWorker& other : workers) {
      other.sync();
    }
    cluster.advance(5'000);
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U);
    worker.fail("it burns");
    worker.sync();
  }
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kFailed);
}

TEST(QueueFaults, FailedShard_GoesToAWorkerWhereItDidNotFail) {
  QueueCluster cluster;
  QueueWorker first(cluster, "first", 1);
  QueueWorker second(cluster, "second", 1);
  second.sync();
  cluster.submit("a", {1});
  first.sync(1);
  first.fail("it burns");
  first.sync();
  cluster.advance(2'000);
  first.sync(1);
  EXPECT_TRUE(first.held.empty());
  second.sync(1);
  EXPECT_EQ(second.held.size(), 1U);
}

TEST(QueueFaults, ShardThatFailed_RunsAlone) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {4});
  worker.sync(1);
  ASSERT_EQ(worker.held[0].shards, 4U);
  worker.fail("it burns");
  worker.sync();
  cluster.advance(2'000);
  worker.sync(4);
  ASSERT_GE(worker.held.size(), 2U);
  EXPECT_EQ(worker.held[0].first_shard, 0U);
  EXPECT_EQ(worker.held[0].shards, 1U);
}

TEST(QueueFaults, ShortResource_CostsNoRetryAndKeepsTheStageAway) {
  QueueSettings settings;
  QueueCluster cluster(settings);
  QueueWorker poor(cluster, "poor", 1);
  QueueWorker rich(cluster, "rich", 1);
  cluster.submit("a", {1});
  std::uint64_t waits_ms = settings.short_ms;
  for (int i = 0; i < 8; ++i) {
    poor.sync(1);
    ASSERT_EQ(poor.held.size(), 1U) << i;
    poor.fail("out of memory", true);
    poor.sync(1);
    EXPECT_TRUE(poor.held.empty());
    EXPECT_NE(cluster.queue.waiting_for(cluster.job("a"), cluster.now), "");
    cluster.advance(waits_ms - 1);
    poor.sync(1);
    EXPECT_TRUE(poor.held.empty());
    cluster.advance(1);
    waits_ms = std::min<std::uint64_t>(2 * waits_ms, settings.short_limit_ms);
  }
  EXPECT_EQ(cluster.job("a").stages[0].failures, 0U);
  rich.sync(1);
  EXPECT_EQ(rich.held.size(), 1U);
}

TEST(QueueFaults, ShardThatTakesItsWorkersWithIt_IsIsolatedAndQuarantined) {
  // Shard 2 kills every worker that runs it.
  QueueCluster cluster;
  cluster.submit("a", {6});
  int workers = 0;
  while (!cluster.job("a").has_ended() && workers < 40) {
    QueueWorker worker(cluster, name_of(workers++), 2);
    bool is_alive = true;
    while (is_alive && !cluster.job("a").has_ended()) {
      worker.sync(1);
      if (worker.held.empty()) {
        break;
      }
      const AssignAction& assign = worker.held[0];
      is_alive = assign.first_shard > 2 || assign.first_shard + assign.shards <= 2;
      if (is_alive) {
        worker.finish();
      }
    }
    cluster.advance(30'001);
  }
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kFailed);
  EXPECT_EQ(cluster.job("a").stages[0].done, 5U);
  EXPECT_NE(cluster.job("a").error.find("shard 2 of 6"), std::string::npos)
      << cluster.job("a").error;
  EXPECT_LE(workers, 12);
}

TEST(QueueFaults, RunsGrow_UntilTheyTakeTheTargetTime) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 2);
  cluster.submit("a", {10'000});
  worker.sync(1);
  EXPECT_EQ(worker.held[0].shards, 2U);  // nothing measured yet
  worker.finish(100);                    // 100 ms for one shard on each of two threads
  worker.sync(1);
  EXPECT_EQ(worker.held[0].shards, 400U);  // 20 s
  worker.finish(400 / 2 * 50);             // it was twice as fast
  worker.sync(1);
  EXPECT_GT(worker.held[0].shards, 400U);
  EXPECT_LT(worker.held[0].shards, 800U);
}

TEST(QueueFaults, SlowShards_AreGivenOneForEachThread) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {100});
  worker.sync(1);
  worker.finish(300'000);
  worker.sync(1);
  EXPECT_EQ(worker.held[0].shards, 4U);
}

TEST(QueueFaults, LastShardsOfAStage_AreSharedOut) {
  QueueCluster cluster;
  QueueWorker first(cluster, "first", 2);
  QueueWorker second(cluster, "second", 2);
  second.sync();
  cluster.submit("a", {102});
  first.sync(1);
  first.finish(1'000);
  second.sync();
  first.sync(1);
  // 20 s would be 40 shards; a share for two workers is 25 of the 100 that are left.
  EXPECT_EQ(first.held[0].shards, 25U);
}

TEST(QueueFaults, BusyWorker_LeavesTheLastShardsToIdleOnes) {
  QueueCluster cluster;
  QueueWorker busy(cluster, "busy", 2);
  QueueWorker idle(cluster, "idle", 2);
  idle.sync();
  cluster.submit("a", {4});
  busy.sync(2);
  ASSERT_EQ(busy.held.size(), 1U);
  idle.sync(2);
  ASSERT_FALSE(idle.held.empty());
  EXPECT_EQ(busy.held[0].shards + idle.held[0].shards, 4U);
}

TEST(QueueFaults, RestartedCoordinator_TakesItsWorkersBackWithWhatTheyRun) {
  QueueCluster before({}, 1);
  QueueWorker old_worker(before, "w", 2);
  before.submit("a", {6});
  old_worker.sync(1);
  ASSERT_EQ(old_worker.held.size(), 1U);

  QueueCluster after({}, 2);
  QueueWorker worker(after, "w", 2);
  Reply known;
  known.assignments = old_worker.held;
  worker.receive(known);
  after.hold_plans = true;
  after.submit("a", {6}, "", core::Digest{});
  // Still planning: the worker goes on, neither renewed nor stopped.
  Reply reply = worker.sync();
  EXPECT_TRUE(reply.stop.empty());
  EXPECT_TRUE(reply.leases.empty());
  after.hold_plans = false;
  after.answer(after.held_plans.at(0));
  reply = worker.sync(1);
  ASSERT_EQ(reply.leases.size(), 1U);
  EXPECT_EQ(reply.leases[0].attempt, old_worker.held[0].attempt);
  ASSERT_EQ(reply.assignments.size(), 1U);
  EXPECT_EQ(reply.assignments[0].first_shard, 2U);  // not what it runs already
  worker.finish();
  worker.sync();
  EXPECT_EQ(after.job("a").stages[0].done, 2U);
}

// A cluster whose coordinator was killed while worker "w" ran the first two shards of job "a".
class QueueRestart : public testing::Test {
 protected:
  QueueRestart() {
    before_.submit("a", {6});
    old_worker_.sync(1);
    after_.prior_attempts = before_.open_attempts;
  }

  QueueCluster before_{{}, 1};
  QueueWorker old_worker_{before_, "w", 2};
  QueueCluster after_{{}, 2};
  QueueWorker other_{after_, "other", 8};
};

TEST_F(QueueRestart, AttemptsFromBeforeIt_OwnTheirShardsBeforeTheirWorkerIsBack) {
  ASSERT_EQ(before_.open_attempts.size(), 1U);
  after_.submit("a", {6}, "", core::Digest{});
  EXPECT_EQ(after_.job("a").stages[0].running, 2U);
  after_.advance(20'000);
  other_.sync(1);
  ASSERT_EQ(other_.held.size(), 1U);
  EXPECT_EQ(other_.held[0].first_shard, 2U);
  EXPECT_EQ(other_.held[0].shards, 4U);
  QueueWorker worker(after_, "w", 2);
  Reply known;
  known.assignments = old_worker_.held;
  worker.receive(known);
  const Reply reply = worker.sync();
  ASSERT_EQ(reply.leases.size(), 1U);
  EXPECT_TRUE(reply.stop.empty());
  EXPECT_TRUE(after_.outcomes.empty());
  EXPECT_EQ(after_.job("a").stages[0].failures, 0U);
}

TEST_F(QueueRestart, AttemptsWhoseWorkerStaysAway_AreLostAfterOneLease) {
  after_.submit("a", {6}, "", core::Digest{});
  after_.advance(30'001);
  other_.sync(2);
  EXPECT_EQ(after_.outcomes.at(old_worker_.held[0].attempt), Outcome::kLost);
  std::uint64_t shards = 0;
  for (const AssignAction& assign : other_.held) {
    shards += assign.shards;
  }
  EXPECT_GE(shards, 5U);
}

TEST_F(QueueRestart, AttemptsWhoseResultsAreThere_AreOver) {
  for (std::uint64_t shard = 0; shard < 2; ++shard) {
    const core::Digest work = QueueCluster::work("a", 0, shard);
    after_.cache[work] = QueueCluster::result_of(work);
  }
  after_.submit("a", {6}, "", core::Digest{});
  EXPECT_TRUE(after_.queue.attempts().empty());
  EXPECT_EQ(after_.outcomes.at(old_worker_.held[0].attempt), Outcome::kSuperseded);
}

TEST(QueueFaults, CompletionFromBeforeARestart_WaitsForThePlanAndIsTaken) {
  QueueCluster before({}, 1);
  QueueWorker old_worker(before, "w", 6);
  before.submit("a", {6});
  old_worker.sync(1);

  QueueCluster after({}, 2);
  QueueWorker worker(after, "w", 6);
  Reply known;
  known.assignments = old_worker.held;
  worker.receive(known);
  old_worker.finish();
  CompletionClaim& claim = worker.finish();
  for (std::uint64_t shard = 0; shard < 6; ++shard) {
    claim.results.push_back({shard, QueueCluster::result_of(QueueCluster::work("a", 0, shard)), 1});
  }
  after.hold_plans = true;
  after.submit("a", {6}, "", core::Digest{});
  worker.sync();
  EXPECT_TRUE(worker.has_unacknowledged());
  after.hold_plans = false;
  after.answer(after.held_plans.at(0));
  worker.sync();
  EXPECT_FALSE(worker.has_unacknowledged());
  EXPECT_EQ(after.job("a").phase, JobPhase::kSucceeded);
}

TEST(QueueFaults, CompletionOfAStageThatIsNotPlannedAgainYet_IsKeptUntilItIs) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  QueueWorker other(cluster, "other", 1);
  other.sync();
  cluster.submit("a", {1, 1});
  worker.sync(1);
  worker.finish();
  worker.sync();
  other.sync(1);  // the second stage
  ASSERT_EQ(other.held.size(), 1U);
  const core::Digest first_work = QueueCluster::work("a", 0, 0);
  const core::Digest first_result = QueueCluster::result_of(first_work);
  cluster.cache.erase(first_work);
  cluster.apply(ResultLostEvent{first_result});
  // The first stage has to be run again before the second one can be planned again.
  CompletionClaim& claim = other.finish();
  claim.results = {{0, QueueCluster::result_of(QueueCluster::work("a", 1, 0)), 1}};
  other.sync();
  EXPECT_TRUE(other.has_unacknowledged());
  worker.sync(1);
  worker.finish();
  worker.sync();
  other.sync();
  EXPECT_FALSE(other.has_unacknowledged());
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kSucceeded);
}

TEST(QueueFaults, FailuresFromBeforeARestart_Count) {
  QueueCluster cluster;
  cluster.hold_plans = true;
  cluster.submit("a", {1}, "", core::Digest{});
  PlannedEvent planned{"a", 0, {}};
  PlannedStage& stage = planned.stages.emplace_back();
  stage.name = all_stages()[0];
  stage.digests = {QueueCluster::work("a", 0, 0)};
  planned.stages[0].failures.assign(4,
                                    PriorFailure{TroubleKind::kFailed, 0, "earlier", "it burned"});
  cluster.apply(planned);
  QueueWorker worker(cluster, "w", 1);
  worker.sync(1);
  worker.fail("it burns");
  worker.sync();
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kFailed);
}

}  // namespace
}  // namespace weft::coordinator
