#include <gtest/gtest.h>

#include "tests/queue_cluster.h"

// Restarts of the coordinator that meet something else: found by seeds of tests/simulation.

namespace weft::coordinator {
namespace {

// A job of two stages: worker "w" runs the second one when the coordinator is killed. The first one
// has to be computed again, for its result is gone.
class QueueSecondStage : public testing::Test {
 protected:
  void SetUp() override {
    cluster_.submit("a", {1, 1});
    worker_.sync(1);
    worker_.finish();
    worker_.sync(1);
    ASSERT_EQ(worker_.held.size(), 1U);
    cluster_.cache.erase(QueueCluster::work("a", 0, 0));
  }
  void restart() {
    cluster_.restart();
    cluster_.prior_attempts = cluster_.open_attempts;  // for the stages planned later on
    ASSERT_EQ(job().stages.size(), 1U);
    ASSERT_FALSE(job().stages[0].is_done());
    // Another stage than these has ended, which adds nothing to the plan.
    cluster_.apply(PlannedEvent{"a", job().generation, {}});
  }
  void do_first_stage() {
    QueueWorker other(cluster_, "other", 1);
    other.sync(1);
    ASSERT_EQ(other.held.size(), 1U);
    other.finish();
    other.sync();
    ASSERT_EQ(job().stages.size(), 2U);
  }
  const JobState& job() { return cluster_.job("a"); }

  QueueCluster cluster_;
  QueueWorker worker_{cluster_, "w", 1};
};

TEST_F(QueueSecondStage, AnAttemptOfAStageThatIsNotPlannedYet_GoesOn) {
  restart();
  EXPECT_TRUE(worker_.sync().stop.empty());
  do_first_stage();
  EXPECT_EQ(job().stages[1].running, 1U);
  const Reply reply = worker_.sync(1);
  EXPECT_EQ(reply.leases.size(), 1U);
  EXPECT_TRUE(reply.assignments.empty());
}

TEST_F(QueueSecondStage, ACompletionOfAStageThatIsNotPlannedYet_IsNotAcknowledged) {
  restart();
  const std::uint64_t attempt = worker_.held[0].attempt;
  worker_.fail("no");
  worker_.sync();
  EXPECT_TRUE(worker_.has_unacknowledged());
  do_first_stage();
  const Reply reply = worker_.send(0);
  worker_.receive(reply);
  EXPECT_FALSE(worker_.has_unacknowledged());
  EXPECT_TRUE(reply.assignments.empty());  // it is not given the same attempt again
  EXPECT_EQ(job().stages[1].failures, 1U);
  EXPECT_EQ(cluster_.outcomes.at(attempt), Outcome::kFailed);
}

TEST_F(QueueSecondStage, AnAttemptStoppedForAPauseBeforeItsStageIsPlanned_IsNotRestored) {
  restart();
  const std::uint64_t attempt = worker_.held[0].attempt;
  cluster_.apply(PauseEvent{"a", true});
  EXPECT_EQ(worker_.sync().stop.size(), 1U);
  EXPECT_EQ(cluster_.outcomes.at(attempt), Outcome::kStopped);
  cluster_.prior_attempts = cluster_.open_attempts;
  cluster_.apply(PauseEvent{"a", false});
  do_first_stage();
  EXPECT_EQ(job().stages[1].running, 0U);
}

TEST_F(QueueSecondStage, AnAttemptOfAJobThatWasBoundToOtherNumbers_IsNotGivenAgain) {
  const core::Digest others = core::digest_of("other numbers");
  restart();
  QueueWorker other(cluster_, "other", 1);
  other.set_fingerprint(others);
  for (int i = 0; i < 14; ++i) {  // the worker stays away
    other.sync();
    cluster_.advance(5'000);
  }
  ASSERT_EQ(job().fingerprint, others);
  other.sync(1);
  other.finish();
  other.sync();
  ASSERT_EQ(job().stages.size(), 2U);
  EXPECT_EQ(job().stages[1].running, 1U);  // until its lease is over, for nobody has looked
  const Reply reply = worker_.send(1);
  EXPECT_TRUE(reply.assignments.empty());
  EXPECT_EQ(reply.stop.size(), 1U);
  EXPECT_EQ(job().stages[1].running, 0U);
}

TEST(QueueAfterARestart, AnAttemptThatHangsOnAfterARestart_IsTakenAwayForGood) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {1});
  worker.sync(1);
  ASSERT_EQ(worker.held.size(), 1U);
  const std::uint64_t attempt = worker.held[0].attempt;
  cluster.restart();
  for (int i = 0; i < 200 && !cluster.outcomes.contains(attempt); ++i) {
    EXPECT_EQ(worker.send(0).leases.size(), 1U);  // it lives, and gets nowhere
    cluster.advance(5'000);
  }
  ASSERT_EQ(cluster.outcomes.at(attempt), Outcome::kHung);
  const Reply reply = worker.send(0);
  EXPECT_TRUE(reply.leases.empty()) << "it was given the attempt back";
  EXPECT_EQ(reply.stop.size(), 1U);
  EXPECT_EQ(cluster.job("a").stages[0].running, 0U);
  EXPECT_EQ(cluster.job("a").stages[0].failures, 1U);
}

TEST(QueueAfterARestart, AJobWasSubmittedWhenItWas) {
  QueueCluster cluster;
  cluster.submit("a", {1});
  const Time submitted_at = cluster.job("a").submitted_at;
  cluster.advance(60'000);
  cluster.restart();
  EXPECT_EQ(cluster.job("a").submitted_at, submitted_at);
}

TEST(QueueAfterARestart, AJobThatHasResults_IsRunningBeforeAnyWorkerIsThere) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {3});
  worker.sync(1);
  ASSERT_LT(worker.held.at(0).shards, 3U);
  worker.finish();
  worker.sync();
  ASSERT_TRUE(cluster.open_attempts.empty());
  cluster.restart();
  EXPECT_EQ(cluster.job("a").stages.at(0).cached, cluster.job("a").stages[0].done);
  EXPECT_GT(cluster.job("a").stages[0].done, 0U);
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kRunning);
}

}  // namespace
}  // namespace weft::coordinator
