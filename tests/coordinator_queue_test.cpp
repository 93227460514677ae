#include <gtest/gtest.h>

#include "coordinator/queue/queue.h"
#include "tests/queue_cluster.h"

namespace weft::coordinator {
namespace {

TEST(Queue, Job_RunsItsStagesInOrderAndIsCommitted) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w");
  cluster.submit("a", {1, 5});
  worker.sync(1);
  for (int turn = 0; turn < 20 && !cluster.job("a").has_ended(); ++turn) {
    ASSERT_FALSE(worker.held.empty());
    worker.finish();
    worker.sync(1);
  }
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kSucceeded);
  ASSERT_EQ(cluster.job("a").stages.size(), 2U);
  for (std::uint64_t shard = 0; shard < 5; ++shard) {
    EXPECT_EQ(cluster.job("a").stages[1].results[shard],
              QueueCluster::result_of(QueueCluster::work("a", 1, shard)));
  }
  EXPECT_EQ(cluster.ended, std::vector<std::string>{"a"});
}

TEST(Queue, Job_WaitsUntilAWorkerIsThere) {
  QueueCluster cluster;
  cluster.submit("a", {1});
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kQueued);
  EXPECT_NE(cluster.queue.waiting_for(cluster.job("a"), cluster.now), "");
  QueueWorker worker(cluster, "w");
  worker.sync(1);
  EXPECT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(cluster.queue.waiting_for(cluster.job("a"), cluster.now), "");
}

TEST(Queue, Assignment_WhoseAnswerWasLostIsSaidAgain) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w");
  cluster.submit("a", {2});
  const Reply lost = worker.send(1);
  ASSERT_EQ(lost.assignments.size(), 1U);
  const Reply again = worker.sync(1);
  ASSERT_EQ(again.assignments.size(), 1U);
  EXPECT_EQ(again.assignments[0].attempt, lost.assignments[0].attempt);
  EXPECT_EQ(again.assignments[0].token, lost.assignments[0].token);
  EXPECT_TRUE(worker.sync(0).assignments.empty());
}

TEST(Queue, Completion_WhoseAcknowledgementWasLostIsAcknowledgedAgain) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w");
  cluster.submit("a", {4, 2});
  worker.sync(1);
  worker.finish();
  EXPECT_EQ(worker.send(0).acknowledged.size(), 1U);
  EXPECT_EQ(worker.sync(0).acknowledged.size(), 1U);
  for (const auto& [work, times] : cluster.results_recorded) {
    EXPECT_EQ(times, 1);
  }
}

TEST(Queue, Lease_LivesAsLongAsItsWorkerReports) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w");
  cluster.submit("a", {1});
  worker.sync(1);
  for (int i = 0; i < 10; ++i) {
    cluster.advance(20'000);
    EXPECT_EQ(worker.sync().leases.size(), 1U);
  }
  EXPECT_EQ(worker.held.size(), 1U);
}

TEST(Queue, ExpiredLease_GivesTheShardsToAnotherWorker) {
  QueueCluster cluster;
  QueueWorker lost(cluster, "lost");
  QueueWorker other(cluster, "other");
  cluster.submit("a", {2});
  lost.sync(1);
  ASSERT_EQ(lost.held.size(), 1U);
  other.sync(2);
  EXPECT_TRUE(other.held.empty());
  cluster.advance(30'001);
  other.sync(2);
  ASSERT_FALSE(other.held.empty());
  std::uint64_t shards = 0;
  for (const AssignAction& assign : other.held) {
    shards += assign.shards;
  }
  EXPECT_EQ(shards, lost.held[0].shards);
}

TEST(Queue, SupersededAttempt_CanNeitherFailNorFreeAnything) {
  QueueCluster cluster;
  QueueWorker slow(cluster, "slow", 1);
  QueueWorker quick(cluster, "quick", 1);
  cluster.submit("a", {1});
  slow.sync(1);
  cluster.advance(30'001);
  quick.sync(1);
  ASSERT_EQ(quick.held.size(), 1U);
  slow.fail("it burns");
  EXPECT_EQ(slow.sync().acknowledged.size(), 1U);
  const StageState& stage = cluster.job("a").stages[0];
  EXPECT_EQ(stage.failures, 0U);
  EXPECT_EQ(stage.running, 1U);
  EXPECT_EQ(quick.sync().leases.size(), 1U);
  // Giving nothing back frees nothing either.
  slow.held = quick.held;
  slow.finish(1000, 0);
  slow.sync();
  EXPECT_EQ(stage.running, 1U);
}

TEST(Queue, SupersededAttempt_MayStillBringASuccess) {
  QueueCluster cluster;
  QueueWorker slow(cluster, "slow", 1);
  QueueWorker quick(cluster, "quick", 1);
  cluster.submit("a", {1, 1});
  slow.sync(1);
  cluster.advance(30'001);
  quick.sync(1);
  slow.finish();
  slow.sync();
  EXPECT_TRUE(cluster.job("a").stages[0].is_done());
  // The attempt that ran the same has nothing left to do.
  EXPECT_EQ(quick.sync().stop.size(), 1U);
  EXPECT_TRUE(quick.held.empty());
}

TEST(Queue, SuccessOfAFinishedShard_ChangesNothing) {
  QueueCluster cluster;
  QueueWorker slow(cluster, "slow", 1);
  QueueWorker quick(cluster, "quick", 1);
  cluster.submit("a", {1, 1});
  slow.sync(1);
  cluster.advance(30'001);
  quick.sync(1);
  ASSERT_EQ(quick.held[0].first_shard, slow.held[0].first_shard);
  quick.finish();
  quick.sync();
  const core::Digest before = cluster.job("a").stages[0].results[0];
  slow.finish().results[0].digest = core::digest_of("something else");
  EXPECT_EQ(slow.sync().acknowledged.size(), 1U);
  EXPECT_EQ(cluster.job("a").stages[0].results[0], before);
}

TEST(Queue, WrongToken_OwnsNothing) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {1});
  worker.sync(1);
  CompletionClaim& claim = worker.finish();
  claim.token[20] = static_cast<char>(claim.token[20] ^ 1);
  EXPECT_EQ(worker.sync().acknowledged.size(), 1U);
  EXPECT_EQ(cluster.job("a").stages[0].done, 0U);
}

TEST(Queue, ResultsOutsideOfTheRun_AreNotTaken) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {3});
  worker.sync(1);
  ASSERT_EQ(worker.held[0].shards, 1U);
  CompletionClaim& claim = worker.finish();
  claim.results.push_back({2, core::digest_of("stray"), 1});
  claim.results.push_back({~std::uint64_t{0}, core::digest_of("stray"), 1});
  worker.sync();
  EXPECT_EQ(cluster.job("a").stages[0].done, 1U);
}

TEST(Queue, PartialCompletion_PutsTheRestBack) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {4});
  worker.sync(1);
  ASSERT_EQ(worker.held[0].shards, 4U);
  worker.finish(1000, 3);
  worker.sync(1);
  EXPECT_EQ(cluster.job("a").stages[0].done, 3U);
  ASSERT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(worker.held[0].first_shard, 3U);
}

TEST(Queue, CancelledJob_StopsItsAttemptsAndLeavesTheOthersAlone) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {4});
  cluster.submit("b", {4});
  worker.sync(1);
  ASSERT_EQ(worker.held[0].job, "a");
  EXPECT_TRUE(cluster.apply(CancelEvent{"a"}).wake);
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kCancelled);
  const Reply reply = worker.sync(1);
  ASSERT_EQ(reply.stop.size(), 1U);
  EXPECT_EQ(reply.stop[0].job, "a");
  ASSERT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(worker.held[0].job, "b");
  // Once more is no change.
  EXPECT_TRUE(cluster.apply(CancelEvent{"a"}).ended.empty());
}

TEST(Queue, JobsOfOneUser_TakeTurnsInTheOrderOfSubmission) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 2);
  cluster.submit("b", {3});
  cluster.submit("a", {3});
  worker.sync(4);
  ASSERT_EQ(worker.held.size(), 4U);
  EXPECT_EQ(worker.held[0].job, "b");
  EXPECT_EQ(worker.held[1].job, "a");
  EXPECT_EQ(worker.held[2].job, "b");
  EXPECT_EQ(worker.held[3].job, "a");
}

TEST(Queue, KnownResults_AreDoneAtOnce) {
  QueueCluster cluster;
  for (std::uint64_t shard = 0; shard < 3; ++shard) {
    const core::Digest work = QueueCluster::work("a", 0, shard);
    cluster.cache[work] = QueueCluster::result_of(work);
  }
  QueueWorker worker(cluster, "w");
  cluster.submit("a", {4});
  worker.sync(4);
  EXPECT_EQ(cluster.job("a").stages[0].cached, 3U);
  ASSERT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(worker.held[0].first_shard, 3U);
  EXPECT_EQ(worker.held[0].shards, 1U);
}

TEST(Queue, JobWhoseResultsAreAllKnown_EndsWithoutWork) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 8);
  cluster.submit("a", {2, 3}, "same");
  for (int turn = 0; turn < 20 && !cluster.job("a").has_ended(); ++turn) {
    worker.sync(2);
    while (!worker.held.empty()) {
      worker.finish();
    }
  }
  ASSERT_EQ(cluster.job("a").phase, JobPhase::kSucceeded);
  cluster.submit("b", {2, 3}, "same");
  EXPECT_EQ(cluster.job("b").phase, JobPhase::kSucceeded);
  EXPECT_EQ(cluster.job("b").stages[1].cached, 3U);
}

TEST(Queue, EqualWorkOfTwoJobs_RunsOnce) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {4}, "same");
  cluster.submit("b", {4}, "same");
  worker.sync(2);
  ASSERT_EQ(worker.held.size(), 1U);
  worker.finish();
  worker.sync(2);
  EXPECT_TRUE(worker.held.empty());
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kSucceeded);
  EXPECT_EQ(cluster.job("b").phase, JobPhase::kSucceeded);
  EXPECT_EQ(cluster.job("a").stages[0].results, cluster.job("b").stages[0].results);
}

TEST(Queue, EqualWork_IsTakenOverWhenTheJobThatRanItIsCancelled) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {4}, "same");
  cluster.submit("b", {4}, "same");
  worker.sync(1);
  cluster.apply(CancelEvent{"a"});
  worker.sync(1);
  ASSERT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(worker.held[0].job, "b");
  EXPECT_EQ(worker.held[0].shards, 4U);
}

TEST(Queue, LeavingWorker_GivesBackAtOnce) {
  QueueCluster cluster;
  QueueWorker leaving(cluster, "leaving", 2);
  QueueWorker other(cluster, "other", 2);
  cluster.submit("a", {2});
  leaving.sync(1);
  leaving.leave();
  EXPECT_FALSE(cluster.queue.workers().contains("leaving"));
  other.sync(1);
  ASSERT_EQ(other.held.size(), 1U);
  EXPECT_EQ(other.held[0].shards, 2U);
  EXPECT_TRUE(cluster.job("a").stages[0].troubles.empty());
}

TEST(Queue, LostResult_MakesItsJobBeginAgain) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 4);
  cluster.submit("a", {1, 4});
  worker.sync(1);
  worker.finish();
  worker.sync(1);
  ASSERT_EQ(worker.held[0].stage, all_stages()[1]);
  const core::Digest work = QueueCluster::work("a", 0, 0);
  cluster.cache.erase(work);
  cluster.apply(ResultLostEvent{QueueCluster::result_of(work)});
  EXPECT_EQ(cluster.job("a").generation, 1U);
  worker.sync(1);
  ASSERT_EQ(worker.held.size(), 1U);
  EXPECT_EQ(worker.held[0].stage, all_stages()[0]);
  // A result that nobody uses is nobody's loss.
  cluster.apply(ResultLostEvent{core::digest_of("unknown")});
  EXPECT_EQ(cluster.job("a").generation, 1U);
}

TEST(Queue, Fingerprints_AreNotMixed) {
  QueueCluster cluster;
  QueueWorker first(cluster, "first", 1);
  QueueWorker second(cluster, "second", 1);
  second.set_fingerprint(core::digest_of("another machine"));
  cluster.submit("a", {8});
  first.sync(1);
  EXPECT_EQ(first.held.size(), 1U);
  second.sync(1);
  EXPECT_TRUE(second.held.empty());
}

TEST(Queue, JobBeginsAgainElsewhere_WhenAllWorkersOfItsFingerprintAreGone) {
  QueueCluster cluster;
  QueueWorker first(cluster, "first", 1);
  QueueWorker second(cluster, "second", 1);
  const core::Digest other = core::digest_of("another machine");
  second.set_fingerprint(other);
  cluster.submit("a", {1, 8});
  first.sync(1);
  first.finish();
  first.sync(1);
  for (int i = 0; i < 10; ++i) {
    cluster.advance(10'000);
    second.sync(1);
  }
  EXPECT_EQ(cluster.job("a").fingerprint, other);
  ASSERT_EQ(second.held.size(), 1U);
  EXPECT_EQ(second.held[0].stage, all_stages()[0]);
}

TEST(Queue, Copy_IsASnapshot) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 2);
  cluster.submit("a", {4});
  const Queue before = cluster.queue;
  worker.sync(1);
  EXPECT_EQ(before.job("a")->phase, JobPhase::kQueued);
  EXPECT_TRUE(before.attempts().empty());
  EXPECT_EQ(cluster.queue.attempts().size(), 1U);
}

}  // namespace
}  // namespace weft::coordinator
