#include <memory>

#include <gtest/gtest.h>

#include "tests/queue_cluster.h"
#include "tests/queue_invariants.h"

// Who is at fault: the task, the worker, or a resource. And what a superseded attempt may do.

namespace weft::coordinator {
namespace {

class QueueVerdicts : public testing::Test {
 protected:
  QueueWorker& join(const std::string& id, const std::string& name = "") {
    workers_.push_back(std::make_unique<QueueWorker>(cluster_, id, 1, name));
    workers_.back()->sync();
    return *workers_.back();
  }
  // Waits for back-offs, while all workers stay in touch.
  void wait(std::uint64_t ms = 20'000) {
    cluster_.advance(ms);
    for (const auto& worker : workers_) {
      worker->sync();
    }
  }
  // The worker is given one attempt, which fails.
  void fail_on(QueueWorker& worker, const std::string& message = "it burns") {
    wait();
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U);
    worker.fail(message);
    worker.sync();
  }
  // The worker does what there is.
  void work(QueueWorker& worker) {
    for (int turn = 0; turn < 50; ++turn) {
      worker.sync(1);
      if (worker.held.empty()) {
        return;
      }
      worker.finish();
    }
  }
  const JobState& job() { return cluster_.job("a"); }
  const StageState& stage() { return job().stages[0]; }

  QueueCluster cluster_;
  std::vector<std::unique_ptr<QueueWorker>> workers_;
};

TEST_F(QueueVerdicts, QuarantinedShard_LetsTheOthersGoOn) {
  QueueWorker& worker = join("w");
  cluster_.submit("a", {3});
  for (int i = 0; i < 5; ++i) {
    fail_on(worker);
  }
  EXPECT_FALSE(job().has_ended());
  EXPECT_EQ(stage().quarantined, 1U);
  ASSERT_EQ(job().troubles.size(), 1U);
  EXPECT_EQ(job().troubles[0].kind, Trouble::Kind::kQuarantined);
  EXPECT_EQ(job().troubles[0].shard, 0U);
  EXPECT_EQ(job().troubles[0].workers, std::vector<std::string>{"w"});
  EXPECT_EQ(job().troubles[0].attempt, cluster_.outcomes.rbegin()->first);
  wait();
  work(worker);
  // Now nothing of it can run any more.
  EXPECT_EQ(job().phase, JobPhase::kFailed);
  EXPECT_EQ(stage().done, 2U);
  EXPECT_NE(job().error.find("geometry shard 0 of 3 is quarantined"), std::string::npos)
      << job().error;
}

TEST_F(QueueVerdicts, OneMachineUnderThreeIds_IsOneWitness) {
  for (const char* id : {"w1", "w2", "w3"}) {
    join(id, "host");
  }
  cluster_.submit("a", {1});
  for (const auto& worker : workers_) {
    fail_on(*worker);
  }
  EXPECT_FALSE(job().has_ended());
}

TEST_F(QueueVerdicts, TheSameErrorOnEveryEligibleWorker_IsTheTasks) {
  QueueWorker& first = join("w1");
  QueueWorker& second = join("w2");
  cluster_.submit("a", {1});
  fail_on(first);
  fail_on(second);
  EXPECT_FALSE(job().has_ended());  // two failures are not enough
  fail_on(first);
  EXPECT_EQ(job().phase, JobPhase::kFailed);
}

TEST_F(QueueVerdicts, DifferentErrors_NeedFiveFailures) {
  QueueWorker& first = join("w1");
  QueueWorker& second = join("w2");
  cluster_.submit("a", {1});
  for (int i = 0; i < 4; ++i) {
    fail_on(i % 2 == 0 ? first : second, std::string("fault ").append(std::to_string(i)));
    EXPECT_FALSE(job().has_ended());
  }
  fail_on(first, "fault 4");
  EXPECT_EQ(job().phase, JobPhase::kFailed);
}

TEST_F(QueueVerdicts, WorkerThatFailsWhatPassesElsewhere_IsBlockedForThatKind) {
  QueueWorker& bad = join("bad");
  QueueWorker& good = join("good");
  cluster_.submit("a", {4, 1});
  for (int i = 0; i < 3; ++i) {
    fail_on(bad, std::string("fault ").append(std::to_string(i)));
  }
  EXPECT_TRUE(cluster_.queue.blocked_stages("bad").empty());
  wait();
  work(good);
  const std::pair<std::string, StageName> kind{"bad", all_stages()[0]};
  ASSERT_TRUE(cluster_.blocked.contains(kind));
  EXPECT_FALSE(cluster_.blocked.at(kind));
  EXPECT_EQ(cluster_.queue.blocked_stages("bad"), std::vector{all_stages()[0]});
  EXPECT_TRUE(cluster_.failures.empty());
  // Other kinds of tasks are another matter.
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  cluster_.submit("b", {1, 8}, "other");
  bad.sync(1);
  EXPECT_TRUE(bad.held.empty());
  good.sync(1);
  good.finish();
  good.sync();
  bad.sync(1);
  ASSERT_EQ(bad.held.size(), 1U);
  EXPECT_EQ(bad.held[0].stage, all_stages()[1]);
}

TEST_F(QueueVerdicts, BlockedWorker_StaysBlockedWhenItStartsAgainAndUntilItIsUnblocked) {
  cluster_.apply(BlockEvent{"host", all_stages()[0], true, false});
  cluster_.submit("a", {1});
  QueueWorker& worker = join("w1", "host");
  worker.sync(1);
  EXPECT_TRUE(worker.held.empty());
  EXPECT_NE(cluster_.queue.waiting_for(job(), cluster_.now).find("blocked"), std::string::npos);
  EXPECT_TRUE(cluster_.apply(BlockEvent{"host", all_stages()[0], false, false}).wake);
  EXPECT_TRUE(cluster_.queue.blocked_stages("host").empty());
  worker.sync(1);
  EXPECT_EQ(worker.held.size(), 1U);
}

TEST_F(QueueVerdicts, BlockedWorkersVerdicts_AreReconsidered) {
  QueueSettings settings;
  settings.failure_limit = 2;
  cluster_ = QueueCluster(settings);
  QueueWorker& bad = join("bad");
  cluster_.submit("a", {8});
  fail_on(bad);
  fail_on(bad);
  EXPECT_EQ(stage().quarantined, 1U);
  for (int i = 0; i < 3; ++i) {
    fail_on(bad, std::string("fault ").append(std::to_string(i)));
    if (stage().quarantined > 1) {
      break;
    }
    QueueWorker& good = join(std::string("good").append(std::to_string(i)));
    wait();
    good.sync(1);
    ASSERT_EQ(good.held.size(), 1U);
    good.finish();
    good.sync();
    good.leave();
    workers_.pop_back();
  }
  ASSERT_FALSE(cluster_.queue.blocked_stages("bad").empty());
  EXPECT_EQ(stage().quarantined, 0U);
  EXPECT_TRUE(job().troubles.empty());
  check_queue(cluster_.queue, cluster_.now);
  QueueWorker& good = join("good");
  wait();
  work(good);
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
}

TEST_F(QueueVerdicts, GoodWorker_IsNotBlockedForItsAge) {
  const QueueSettings settings;
  Conduct conduct;
  conduct.passed = 1'000;
  conduct.passed_elsewhere = settings.block_limit;
  EXPECT_FALSE(conduct.is_bad(settings));
  conduct.passed = 10;
  EXPECT_TRUE(conduct.is_bad(settings));
}

TEST_F(QueueVerdicts, WorkerThatFailsAgainAndAgain_WaitsLongerEachTime) {
  QueueWorker& bad = join("bad");
  cluster_.submit("a", {100});
  for (int i = 0; i < 4; ++i) {
    cluster_.advance(i < 2 ? 0 : 8'000);
    bad.sync(1);
    ASSERT_EQ(bad.held.size(), 1U) << i;
    bad.fail("it burns");
    bad.sync();
  }
  cluster_.advance(3'999);
  bad.sync(1);
  EXPECT_TRUE(bad.held.empty());
  cluster_.advance(1);
  bad.sync(1);
  EXPECT_EQ(bad.held.size(), 1U);
}

TEST_F(QueueVerdicts, ShardThatKillsWorkersWhichSurviveOthers_IsQuarantinedAsAKiller) {
  cluster_.submit("a", {2});
  QueueWorker& first = join("w0", "host");
  work(first);  // it survives the first shard; the job has ended
  cluster_.submit("b", {1, 1});
  for (int i = 1; i <= 5; ++i) {
    EXPECT_FALSE(cluster_.job("b").has_ended());
    QueueWorker& worker = join(std::string("w").append(std::to_string(i)), "host");
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U);
    cluster_.apply(DisconnectEvent{worker.says().worker});
  }
  ASSERT_EQ(cluster_.job("b").phase, JobPhase::kFailed);
  EXPECT_EQ(cluster_.job("b").troubles[0].kind, Trouble::Kind::kKiller);
  EXPECT_EQ(cluster_.job("b").stages[0].failures, 0U);  // losses are no failures
}

// Machines that somebody kills again and again: what they hold then is not to blame.
TEST_F(QueueVerdicts, WorkersThatDieElsewhereAsOften_AreNoWitnessesAgainstATask) {
  constexpr int kElsewhere = 4;
  cluster_.submit("a", {1});
  work(join("w0", "host"));  // it gives results
  int lost = 0;
  const auto lose_one = [&] {
    QueueWorker& worker = join(std::string("w").append(std::to_string(++lost)), "host");
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U);
    cluster_.apply(DisconnectEvent{worker.says().worker});
  };
  cluster_.submit("c", {20});
  for (int i = 0; i < kElsewhere; ++i) {
    lose_one();
  }
  cluster_.apply(CancelEvent{"c"});
  cluster_.submit("b", {1});
  for (int i = 0; i < 5 + kElsewhere - 1; ++i) {
    lose_one();
    EXPECT_FALSE(cluster_.job("b").has_ended()) << i;
  }
  lose_one();
  EXPECT_EQ(cluster_.job("b").phase, JobPhase::kFailed);
}

TEST_F(QueueVerdicts, LossesElsewhere_OutweighThoseOfTheSameNameUntilItIsHopeless) {
  ShardTrouble trouble;
  trouble.lone_losses.assign(5, LoneLoss{"host", {}, true});
  EXPECT_TRUE(judge_losses(trouble, {}, {}));
  EXPECT_TRUE(judge_losses(trouble, {{"other", 9}}, {}));
  EXPECT_FALSE(judge_losses(trouble, {{"host", 1}}, {}));
  trouble.lone_losses.assign(24, LoneLoss{"host", {}, true});
  EXPECT_FALSE(judge_losses(trouble, {{"host", 99}}, {}));
  trouble.lone_losses.push_back({"host", {}, true});
  EXPECT_TRUE(judge_losses(trouble, {{"host", 99}}, {}));
}

TEST_F(QueueVerdicts, LossesElsewhere_CountAcrossARestart) {
  for (const bool is_elsewhere : {false, true}) {
    QueueCluster cluster;
    cluster.hold_plans = true;
    cluster.submit("a", {2}, "", core::Digest{});
    PlannedEvent planned{"a", 0, {}};
    PlannedStage& stage = planned.stages.emplace_back();
    stage.name = all_stages()[0];
    stage.digests = {QueueCluster::work("a", 0, 0), QueueCluster::work("a", 0, 1)};
    stage.failures.assign(5, {TroubleKind::kLoneLoss, 0, "host", "its worker fell silent"});
    stage.losses.push_back({"w1", "host", is_elsewhere ? 1U : 0U, 1, cluster.now});
    cluster.apply(planned);
    EXPECT_EQ(cluster.job("a").stages[0].quarantined, is_elsewhere ? 0U : 1U);
  }
}

TEST_F(QueueVerdicts, WorkersThatDieOfEverything_AreNoWitnessesAgainstATask) {
  cluster_.submit("a", {1});
  for (int i = 0; i < 9; ++i) {
    QueueWorker& worker = join(std::string("w").append(std::to_string(i)));
    worker.sync(1);
    ASSERT_EQ(worker.held.size(), 1U);
    cluster_.apply(DisconnectEvent{worker.says().worker});
  }
  EXPECT_FALSE(job().has_ended());
  join("last");
  work(*workers_.back());
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
}

TEST_F(QueueVerdicts, LoneLosses_CountAcrossARestart) {
  QueueWorker& worker = join("w", "host");
  cluster_.submit("a", {1});
  worker.sync(1);
  cluster_.apply(DisconnectEvent{"w"});
  ASSERT_EQ(cluster_.failures.size(), 1U);
  EXPECT_EQ(cluster_.failures[0].kind, TroubleKind::kLoneLoss);
  cluster_.restart();
  ASSERT_EQ(stage().troubles.size(), 1U);
  EXPECT_EQ(stage().troubles.at(0).lone_losses.size(), 1U);
}

TEST_F(QueueVerdicts, WorkerThatWasOnlyCutOff_GoesOnAndItsShardIsNotBlamed) {
  QueueWorker& worker = join("w");
  cluster_.submit("a", {1});
  worker.sync(1);
  cluster_.apply(DisconnectEvent{"w"});
  EXPECT_EQ(stage().running, 0U);
  const Reply reply = worker.sync();
  EXPECT_EQ(reply.leases.size(), 1U);
  EXPECT_TRUE(reply.stop.empty());
  EXPECT_EQ(stage().running, 1U);
  EXPECT_TRUE(stage().troubles.empty());
  EXPECT_EQ(cluster_.open_attempts.size(), 1U);
}

TEST_F(QueueVerdicts, ReportInTheMomentTheLeaseEnds_KeepsTheAttempt) {
  QueueWorker& worker = join("w");
  cluster_.submit("a", {1});
  worker.sync(1);
  for (int i = 0; i < 6; ++i) {
    cluster_.advance(5'000);
  }
  cluster_.now += std::chrono::milliseconds(1);
  EXPECT_EQ(worker.sync().leases.size(), 1U);
  EXPECT_EQ(cluster_.open_attempts.size(), 1U);
  EXPECT_TRUE(cluster_.outcomes.empty());
}

TEST_F(QueueVerdicts, SupersededAttempts_AreCountedOnceAndSoAreTheirResults) {
  QueueWorker& slow = join("slow");
  QueueWorker& quick = join("quick");
  cluster_.submit("a", {2, 4});
  slow.sync(1);
  cluster_.apply(DisconnectEvent{"slow"});
  quick.sync(2);
  ASSERT_FALSE(quick.held.empty());
  slow.finish();
  slow.send(0);  // its acknowledgement is lost
  slow.sync();
  EXPECT_EQ(job().superseded_attempts, 1U);
  EXPECT_EQ(job().superseded_results_used, 1U);
  EXPECT_EQ(cluster_.queue.workers().at("slow").superseded, 1U);
  // A report that is only repeated is not superseded.
  quick.held.clear();
  EXPECT_EQ(cluster_.queue.workers().at("quick").superseded, 0U);
}

TEST_F(QueueVerdicts, RestartedWorker_CompletesWhatItsForerunnerOwned) {
  QueueWorker& before = join("w1", "host");
  cluster_.submit("a", {1, 1});
  before.sync(1);
  const CompletionClaim claim = before.finish();
  QueueWorker& after = join("w2", "host");
  after.says().completions.push_back(claim);
  after.sync();
  EXPECT_TRUE(stage().is_done());
  EXPECT_EQ(cluster_.outcomes.at(claim.attempt), Outcome::kSucceeded);
  EXPECT_EQ(job().superseded_attempts, 0U);
}

}  // namespace
}  // namespace weft::coordinator
