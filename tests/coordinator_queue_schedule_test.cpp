#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "tests/queue_cluster.h"
#include "tests/queue_invariants.h"

// Whose turn it is, who may run what, and what is done about attempts that are slow or hang.

namespace weft::coordinator {
namespace {

class QueueSchedule : public testing::Test {
 protected:
  explicit QueueSchedule(QueueSettings settings = {}) : cluster_(settings) {}
  // Of which job the worker is given something next, in so many turns.
  std::string turns(QueueWorker& worker, int count) {
    std::string jobs;
    for (int i = 0; i < count; ++i) {
      worker.sync(1);
      if (worker.held.empty()) {
        break;
      }
      jobs += worker.held[0].job;
      worker.finish(30'000);  // so long that a run is one shard
      worker.sync();
    }
    return jobs;
  }

  QueueCluster cluster_;
  QueueWorker worker_{cluster_, "w", 1};
};

TEST_F(QueueSchedule, HigherPriority_GoesFirst) {
  cluster_.submit_for("u", "a", {4}, 0);
  cluster_.submit_for("u", "b", {4}, 1);
  EXPECT_EQ(turns(worker_, 8), "bbbbaaaa");
}

TEST_F(QueueSchedule, Waiting_RaisesThePriorityOneStepEachFiveMinutes) {
  cluster_.submit_for("u", "a", {4}, 0);
  cluster_.submit_for("u", "b", {400}, 2);
  cluster_.submit_for("u", "c", {400}, 2);
  std::string served;
  for (int minute = 0; minute < 21 && served.find('a') == std::string::npos; ++minute) {
    served += turns(worker_, 2);
    cluster_.advance(60'000);
    worker_.sync();
  }
  EXPECT_NE(served.find('a'), std::string::npos) << served;
  EXPECT_GE(served.size(), 20U);  // but not before ten minutes
  EXPECT_EQ(cluster_.queue.priority(cluster_.job("a"), cluster_.now), 0);
}

TEST_F(QueueSchedule, Users_ShareEquallyHoweverManyJobsTheyHave) {
  cluster_.submit_for("many", "a", {100});
  cluster_.submit_for("many", "b", {100});
  cluster_.submit_for("many", "c", {100});
  cluster_.submit_for("one", "d", {100});
  const std::string served = turns(worker_, 60);
  const auto of_d = std::count(served.begin(), served.end(), 'd');
  EXPECT_NEAR(static_cast<double>(of_d), 30, 2) << served;
  for (const char job : {'a', 'b', 'c'}) {
    EXPECT_NEAR(static_cast<double>(std::count(served.begin(), served.end(), job)), 10, 2);
  }
}

TEST_F(QueueSchedule, LateUser_NeitherCatchesUpNorWaits) {
  cluster_.submit_for("early", "a", {100});
  turns(worker_, 40);
  cluster_.submit_for("late", "b", {100});
  const std::string served = turns(worker_, 20);
  EXPECT_NEAR(static_cast<double>(std::count(served.begin(), served.end(), 'b')), 10, 2) << served;
}

TEST_F(QueueSchedule, Scene_DrawsWorkersButStarvesNobody) {
  QueueCluster& cluster = cluster_;
  cluster.hold_plans = true;
  const core::Digest scene = core::digest_of("tile");
  for (const char* id : {"a", "b"}) {
    cluster.submit_for(id, id, {60});
    cluster.apply(TickEvent{});
  }
  worker_.says().scenes = {scene};
  worker_.sync();
  for (const PlanAction& plan : cluster.held_plans) {
    PlannedStage stage;
    stage.name = all_stages()[0];
    stage.scene = plan.job == "b" ? scene : core::digest_of("another tile");
    for (std::uint64_t i = 0; i < 60; ++i) {
      stage.digests.push_back(QueueCluster::work(plan.job, 0, i));
    }
    cluster.apply(PlannedEvent{plan.job, plan.generation, {stage}});
  }
  QueueWorker other(cluster, "other", 1);
  other.says().scenes = {core::digest_of("another tile")};
  for (int turn = 0; turn < 10; ++turn) {  // to each its own, though "a" was submitted first
    EXPECT_EQ(turns(worker_, 1), "b");
    EXPECT_EQ(turns(other, 1), "a");
  }
  const std::string served = turns(worker_, 40);  // now it is alone
  const auto of_a = std::count(served.begin(), served.end(), 'a');
  EXPECT_GE(of_a, 15) << served;
  EXPECT_LT(of_a, 20) << served;
}

TEST_F(QueueSchedule, Labels_ChooseTheWorkers) {
  JobDemands demands;
  demands.labels = {"gpu", "big"};
  cluster_.submit("a", {1}, "", {}, demands);
  worker_.says().labels = {"gpu"};
  worker_.sync(1);
  EXPECT_TRUE(worker_.held.empty());
  worker_.says().labels = {"big", "gpu", "more"};
  worker_.sync(1);
  EXPECT_EQ(worker_.held.size(), 1U);
}

TEST_F(QueueSchedule, LastShards_AreNotLeftToIdleWorkersThatMayNotRunThem) {
  JobDemands demands;
  demands.labels = {"gpu"};
  QueueWorker idle(cluster_, "idle", 8);
  idle.sync();
  worker_.says().labels = {"gpu"};
  cluster_.submit("a", {2}, "", {}, demands);
  worker_.sync(2);
  EXPECT_EQ(worker_.held.size(), 2U);
}

TEST_F(QueueSchedule, DrainedWorker_FinishesAndGetsNothingNew) {
  cluster_.submit("a", {4});
  worker_.sync(1);
  cluster_.apply(DrainEvent{"w", true});
  EXPECT_EQ(worker_.sync(1).leases.size(), 1U);
  worker_.finish();
  worker_.sync(1);
  EXPECT_TRUE(worker_.held.empty());
  EXPECT_EQ(cluster_.job("a").stages[0].done, 1U);
  cluster_.apply(DrainEvent{"w", false});
  worker_.sync(1);
  EXPECT_EQ(worker_.held.size(), 1U);
}

TEST_F(QueueSchedule, Memory_IsNotPromisedTwice) {
  cluster_.hold_plans = true;
  worker_.says().memory_bytes = 100;
  worker_.sync();
  for (const char* id : {"a", "b", "c"}) {
    cluster_.submit_for("u", id, {2});
  }
  const std::map<std::string, std::uint64_t> needs = {{"a", 60}, {"b", 60}, {"c", 200}};
  for (const PlanAction& plan : cluster_.held_plans) {
    PlannedStage stage;
    stage.name = all_stages()[0];
    stage.memory_bytes = needs.at(plan.job);
    stage.digests = {QueueCluster::work(plan.job, 0, 0), QueueCluster::work(plan.job, 0, 1)};
    cluster_.apply(PlannedEvent{plan.job, plan.generation, {stage}});
  }
  worker_.sync(6);
  ASSERT_EQ(worker_.held.size(), 2U);  // both shards of one job: they share what they need
  EXPECT_EQ(worker_.held[0].job, worker_.held[1].job);
  EXPECT_NE(cluster_.queue.waiting_for(cluster_.job("c"), cluster_.now).find("less memory"),
            std::string::npos);
}

TEST_F(QueueSchedule, WorkerAboutToEnd_GetsOnlyWhatItCanFinish) {
  cluster_.submit("a", {100});
  worker_.says().wall_left_ms = 59'000;
  worker_.sync(1);
  EXPECT_TRUE(worker_.held.empty());  // how long shards take is not known yet
  QueueWorker other(cluster_, "other", 1);
  other.sync(1);
  other.finish(4'000);
  other.sync();
  worker_.says().wall_left_ms = 11'000;
  worker_.sync(1);
  ASSERT_EQ(worker_.held.size(), 1U);
  EXPECT_EQ(worker_.held[0].shards, 2U);
  worker_.finish(8'000);
  worker_.says().wall_left_ms = 3'000;
  worker_.sync(1);
  EXPECT_TRUE(worker_.held.empty());
}

TEST_F(QueueSchedule, PausedJob_StopsAndKeepsWhatItHas) {
  cluster_.submit("a", {4});
  worker_.sync(1);
  worker_.finish(30'000);
  worker_.sync(1);
  ASSERT_EQ(worker_.held.size(), 1U);
  cluster_.apply(PauseEvent{"a", true});
  EXPECT_EQ(worker_.sync(1).stop.size(), 1U);
  EXPECT_TRUE(worker_.held.empty());
  EXPECT_EQ(cluster_.job("a").stages[0].done, 1U);
  EXPECT_EQ(cluster_.job("a").superseded_attempts, 0U);
  cluster_.apply(PauseEvent{"a", false});
  EXPECT_EQ(turns(worker_, 4), "aaa");
}

TEST_F(QueueSchedule, UnfinishedJobs_AreCountedByUser) {
  cluster_.submit_for("u", "a", {1});
  cluster_.submit_for("u", "b", {1});
  cluster_.submit_for("v", "c", {1});
  EXPECT_EQ(cluster_.queue.unfinished_jobs_of("u"), 2U);
  cluster_.apply(CancelEvent{"a"});
  EXPECT_EQ(cluster_.queue.unfinished_jobs_of("u"), 1U);
}

TEST_F(QueueSchedule, Runs_GetShorterTowardsTheEndOfAStage) {
  cluster_.submit("a", {1000, 1});
  QueueWorker other(cluster_, "other", 1);
  worker_.sync(1);
  worker_.finish(100);  // each shard takes 0.1 s
  worker_.sync(1);
  other.sync(1);
  std::vector<std::uint64_t> sizes;
  while (!cluster_.job("a").stages[0].is_done()) {
    for (QueueWorker* const worker : {&worker_, &other}) {
      if (!worker->held.empty()) {
        sizes.push_back(worker->held[0].shards);
        worker->finish(100 * worker->held[0].shards);
      }
      worker->sync(1);
    }
    ASSERT_LT(sizes.size(), 1000U);
  }
  // 20 seconds at first; the last ones no longer than half a second.
  EXPECT_EQ(*std::max_element(sizes.begin(), sizes.end()), 200U);
  EXPECT_TRUE(std::is_sorted(sizes.rbegin(), sizes.rend()));
  EXPECT_LE(sizes.back(), 5U);
}

// ---- slow and hung attempts

class QueueWatch : public QueueSchedule {
 protected:
  // Runs that are not cut up towards the end of a stage.
  QueueWatch()
      : QueueSchedule([] {
          QueueSettings settings;
          settings.last_run_ms = 5'000;
          return settings;
        }()) {}
  // The worker holds one run that should take 4 s; nothing else is pending.
  void begin_slow_run() {
    cluster_.submit("a", {5, 1});
    worker_.sync(1);
    worker_.finish(1'000);
    worker_.sync(1);
    ASSERT_EQ(worker_.held.size(), 1U);
    ASSERT_EQ(worker_.held[0].shards, 4U);
  }
  void wait(std::uint64_t ms) {
    for (std::uint64_t passed = 0; passed < ms; passed += 1'000) {
      cluster_.advance(1'000);
      worker_.sync();
    }
  }
  QueueWorker idle_{cluster_, "idle", 2};
};

TEST_F(QueueWatch, SlowRun_IsRunASecondTimeByAnIdleWorker) {
  begin_slow_run();
  wait(9'000);
  idle_.sync(1);
  EXPECT_TRUE(idle_.held.empty());
  wait(5'000);
  idle_.sync(1);
  ASSERT_EQ(idle_.held.size(), 1U);
  EXPECT_EQ(idle_.held[0].purpose, Purpose::kSpeculation);
  EXPECT_EQ(cluster_.job("a").speculative_attempts, 1U);
  check_queue(cluster_.queue, cluster_.now);
  // Nobody runs it a third time.
  QueueWorker another(cluster_, "another", 2);
  another.sync(1);
  EXPECT_TRUE(another.held.empty());
  // The first result wins, and the other is stopped.
  idle_.finish();
  idle_.sync();
  EXPECT_TRUE(cluster_.job("a").stages[0].is_done());
  EXPECT_EQ(worker_.sync().stop.size(), 1U);
  EXPECT_EQ(cluster_.job("a").stages[0].failures, 0U);
}

TEST_F(QueueWatch, LostSpeculation_FreesNothingThatTheFirstAttemptRuns) {
  begin_slow_run();
  wait(14'000);
  idle_.sync(1);
  ASSERT_EQ(idle_.held.size(), 1U);
  cluster_.apply(DisconnectEvent{"idle"});
  EXPECT_EQ(cluster_.job("a").stages[0].running, 4U);
  EXPECT_EQ(cluster_.job("a").stages[0].pending(), 0U);
  check_queue(cluster_.queue, cluster_.now);
  worker_.finish();
  worker_.sync();
  EXPECT_TRUE(cluster_.job("a").stages[0].is_done());
}

TEST_F(QueueWatch, LostFirstAttempt_LeavesItsShardsToTheSpeculation) {
  begin_slow_run();
  wait(14'000);
  idle_.sync(1);
  const std::uint64_t doubled = idle_.held.at(0).shards;
  cluster_.apply(DisconnectEvent{"w"});
  EXPECT_EQ(cluster_.job("a").stages[0].running, doubled);
  check_queue(cluster_.queue, cluster_.now);
  for (int turn = 0; turn < 10 && !cluster_.job("a").has_ended(); ++turn) {
    if (!idle_.held.empty()) {
      idle_.finish();
    }
    idle_.sync(1);
  }
  EXPECT_EQ(cluster_.job("a").phase, JobPhase::kSucceeded);
}

TEST_F(QueueWatch, FailedSpeculation_DoesNotEndTheFirstAttempt) {
  begin_slow_run();
  wait(14'000);
  idle_.sync(1);
  idle_.fail("it burns");
  idle_.sync();
  check_queue(cluster_.queue, cluster_.now);
  worker_.finish();
  worker_.sync();
  EXPECT_TRUE(cluster_.job("a").stages[0].is_done());
}

TEST_F(QueueWatch, AttemptWithoutProgress_IsTakenAway) {
  cluster_.submit("a", {1});
  worker_.sync(1);
  for (int i = 0; i < 30; ++i) {  // ten minutes with progress ...
    worker_.says().running[0].progress += 1;
    wait(20'000);
  }
  EXPECT_EQ(worker_.held.size(), 1U);
  const std::uint64_t attempt = worker_.held[0].attempt;
  wait(600'000);  // ... and ten without
  EXPECT_TRUE(worker_.held.empty());
  EXPECT_EQ(cluster_.outcomes.at(attempt), Outcome::kHung);
  ASSERT_EQ(cluster_.failures.size(), 1U);
  EXPECT_EQ(cluster_.failures[0].kind, TroubleKind::kHung);
  idle_.sync(1);
  EXPECT_EQ(idle_.held.size(), 1U);
}

TEST_F(QueueWatch, WorkerThatCannotDeliver_IsNeitherSlowNorHungAndGetsNothing) {
  begin_slow_run();
  cluster_.submit("b", {9});
  worker_.says().undelivered = "there is no room";
  for (int i = 0; i < 3; ++i) {
    wait(300'000);
    EXPECT_EQ(worker_.sync(1).leases.size(), 1U);
    EXPECT_EQ(worker_.held.size(), 1U) << "it was given more";
  }
  worker_.says().undelivered.clear();
  wait(1'000);
  EXPECT_EQ(worker_.held.size(), 1U) << "it was taken away";
  QueueWorker late(cluster_, "late", 2);
  late.sync(2);
  for (const AssignAction& assign : late.held) {
    EXPECT_NE(assign.purpose, Purpose::kSpeculation) << "the time that it waited counts";
  }
  worker_.finish();
  worker_.sync();
  EXPECT_TRUE(cluster_.job("a").stages[0].is_done());
  EXPECT_EQ(cluster_.job("a").speculative_attempts, 0U);
}

TEST_F(QueueWatch, ClockThatJumps_EndsNoLease) {
  cluster_.submit("a", {1});
  worker_.sync(1);
  cluster_.now += std::chrono::hours(2);
  cluster_.apply(TickEvent{});
  EXPECT_EQ(worker_.sync().leases.size(), 1U);
  cluster_.now -= std::chrono::hours(5);
  cluster_.apply(TickEvent{});
  EXPECT_EQ(worker_.sync().leases.size(), 1U);
  // Afterwards time passes as ever.
  cluster_.advance(30'001);
  EXPECT_TRUE(cluster_.queue.attempts().empty());
}

}  // namespace
}  // namespace weft::coordinator
