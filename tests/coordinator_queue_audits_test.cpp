#include <gtest/gtest.h>

#include "coordinator/scheduler/messages.h"
#include "tests/queue_cluster.h"
#include "tests/queue_invariants.h"

// Results that a second worker confirms, and results that differ.

namespace weft::coordinator {
namespace {

class QueueAudits : public testing::Test {
 protected:
  static void work(QueueWorker& worker, const std::string& lie = "") {
    for (int turn = 0; turn < 50; ++turn) {
      worker.sync(1);
      if (worker.held.empty()) {
        return;
      }
      worker.finish(30'000, ~std::uint64_t{0}, lie);  // so long that a run is one shard
      worker.sync();
    }
  }
  const JobState& job() { return cluster_.job("a"); }

  QueueCluster cluster_;
  QueueWorker first_{cluster_, "first", 1};
  QueueWorker second_{cluster_, "second", 1};
  QueueWorker third_{cluster_, "third", 1};
};

TEST_F(QueueAudits, AuditedJob_IsCommittedWhenAnotherWorkerGaveTheSame) {
  cluster_.submit_audited("a", {3}, 1);
  work(first_);
  EXPECT_TRUE(job().stages[0].is_done());
  EXPECT_FALSE(job().has_ended());
  work(first_);  // it cannot confirm its own
  EXPECT_FALSE(job().has_ended());
  second_.sync(1);
  ASSERT_EQ(second_.held.size(), 1U);
  EXPECT_EQ(second_.held[0].purpose, Purpose::kAudit);
  second_.finish();
  second_.sync();
  work(second_);
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  EXPECT_EQ(job().audited_shards, 3U);
  EXPECT_EQ(cluster_.audited.size(), 3U);
}

TEST_F(QueueAudits, TheShareIsChosenByTheWorkAlone) {
  for (const double share : {0.0, 0.25, 1.0}) {
    QueueCluster cluster;
    QueueWorker worker(cluster, "w", 64);
    worker.sync();
    cluster.submit_audited("a", {2'000, 1}, share);
    for (int turn = 0;
         turn < 200 && !cluster.job("a").stages.empty() && !cluster.job("a").stages[0].is_done();
         ++turn) {
      worker.sync(1);
      if (!worker.held.empty()) {
        worker.finish();
      }
    }
    worker.sync();
    const auto chosen = static_cast<double>(cluster.job("a").stages[0].unconfirmed());
    EXPECT_NEAR(chosen, 2'000 * share, share > 0 && share < 1 ? 60 : 0.5) << share;
  }
}

TEST_F(QueueAudits, ALiarIsFoundByAThirdWorkerAndBlocked) {
  cluster_.submit_audited("a", {1, 2}, 1);
  first_.sync(1);
  first_.finish(1'000, ~std::uint64_t{0}, "a lie");
  first_.sync();
  second_.sync(1);  // the audit of the first stage comes before the second stage's shards, or after
  for (int turn = 0; turn < 10 && cluster_.mismatches.empty(); ++turn) {
    work(second_);
  }
  ASSERT_EQ(cluster_.mismatches.size(), 1U);
  EXPECT_EQ(cluster_.mismatches[0].worker, "first");
  EXPECT_EQ(cluster_.mismatches[0].other_worker, "second");
  EXPECT_EQ(cluster_.mismatches[0].liar, "");
  ASSERT_EQ(job().troubles.size(), 1U);
  EXPECT_EQ(job().troubles[0].kind, Trouble::Kind::kMismatch);
  work(third_);
  ASSERT_GE(cluster_.mismatches.size(), 2U);
  EXPECT_EQ(cluster_.mismatches[1].liar, "first");
  EXPECT_TRUE(cluster_.queue.is_liar("first", all_stages()[0]));
  // What was computed from the wrong result is computed again, and all is right in the end.
  for (int turn = 0; turn < 10 && !job().has_ended(); ++turn) {
    work(second_);
    work(third_);
    check_queue(cluster_.queue, cluster_.now);
  }
  ASSERT_EQ(job().phase, JobPhase::kSucceeded) << job().error;
  EXPECT_EQ(job().stages[0].results[0], QueueCluster::result_of(QueueCluster::work("a", 0, 0)));
  EXPECT_EQ(job().troubles[0].liar, "first");
}

TEST_F(QueueAudits, ALateResultThatDiffers_IsAnAlarmToo) {
  cluster_.submit("a", {1, 4});
  first_.sync(1);
  cluster_.apply(DisconnectEvent{"first"});
  second_.sync(1);
  second_.finish();
  second_.sync();
  first_.finish(1'000, ~std::uint64_t{0}, "a lie");
  first_.sync();
  ASSERT_EQ(cluster_.mismatches.size(), 1U);
  EXPECT_EQ(job().stages[0].disputed.size(), 1U);
  work(third_);
  EXPECT_TRUE(cluster_.queue.is_liar("first", all_stages()[0]));
  EXPECT_FALSE(cluster_.queue.is_liar("second", all_stages()[0]));
  // The recorded result was right: nothing begins again.
  EXPECT_EQ(job().generation, 0U);
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
}

TEST_F(QueueAudits, AllThatALiarGave_IsConfirmedByOthers) {
  cluster_.submit("a", {3, 1});
  work(first_);  // all of the first stage, and the second
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  cluster_.submit("b", {4, 1});
  first_.sync(3);
  ASSERT_EQ(first_.held.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    first_.finish();
  }
  first_.sync(1);
  cluster_.apply(DisconnectEvent{"first"});
  second_.sync(1);
  second_.finish();
  second_.sync();
  first_.finish(1'000, ~std::uint64_t{0}, "a lie");
  first_.sync();
  const JobState& b = cluster_.job("b");
  EXPECT_FALSE(b.has_ended());
  work(third_);
  EXPECT_EQ(b.phase, JobPhase::kSucceeded);
  EXPECT_EQ(b.audited_shards, 4U);  // the disputed one, and the three others of the liar
}

TEST_F(QueueAudits, WithoutASecondName_AuditsAreGivenUpAndCounted) {
  cluster_.submit_audited("a", {2}, 1);
  work(first_);
  for (int i = 0; i < 12; ++i) {
    EXPECT_FALSE(job().has_ended());
    cluster_.advance(5'000);
    first_.sync(1);
  }
  cluster_.advance(5'000);
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  EXPECT_EQ(job().audits_given_up, 2U);
  EXPECT_EQ(message_of(cluster_.queue, job(), cluster_.now).audits_given_up(), 2U);
}

TEST_F(QueueAudits, AWorkerThatMustEndSoon_IsNoReasonToWait) {
  cluster_.submit_audited("a", {2}, 1);
  work(first_);
  second_.says().wall_left_ms = 20'000;  // a shard takes 30 s
  for (int i = 0; i < 14 && !job().has_ended(); ++i) {
    cluster_.advance(5'000);
    first_.sync(1);
    second_.sync(1);
    ASSERT_TRUE(second_.held.empty());
  }
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  EXPECT_EQ(job().audits_given_up, 2U);
}

TEST_F(QueueAudits, ADisputeThatNobodyCanSettle_FailsTheJobAndKeepsNoResult) {
  cluster_.submit_audited("a", {1}, 1);
  work(first_, "a lie");
  work(second_);
  for (int i = 0; i < 14 && !job().has_ended(); ++i) {
    cluster_.advance(5'000);
    first_.sync();
    second_.sync();
  }
  EXPECT_EQ(job().phase, JobPhase::kFailed);
  EXPECT_NE(job().error.find("first, second"), std::string::npos) << job().error;
  EXPECT_TRUE(cluster_.cache.empty());
}

TEST_F(QueueAudits, Audits_SurviveARestart) {
  cluster_.submit_audited("a", {4}, 1);
  work(first_);
  second_.sync(1);
  second_.finish();
  second_.sync(1);
  ASSERT_EQ(cluster_.audited.size(), 1U);
  cluster_.restart();
  EXPECT_EQ(job().stages[0].unconfirmed(), 3U);
  EXPECT_EQ(second_.sync(1).leases.size(), 1U);  // it goes on with its audit
  while (!second_.held.empty()) {
    second_.finish();
    second_.sync(1);
  }
  EXPECT_EQ(job().phase, JobPhase::kSucceeded);
  EXPECT_EQ(cluster_.audited.size(), 4U);
}

TEST_F(QueueAudits, AMismatchWithoutAVerdict_IsToldAndLookedIntoAfterARestart) {
  cluster_.submit("a", {1, 4});
  first_.sync(1);
  cluster_.apply(DisconnectEvent{"first"});
  second_.sync(1);
  second_.finish();
  second_.sync();
  first_.finish(1'000, ~std::uint64_t{0}, "a lie");  // comes late: nobody had asked for an audit
  first_.sync();
  const std::vector<Trouble> before = job().troubles;
  ASSERT_EQ(before.size(), 1U);
  cluster_.restart();
  ASSERT_EQ(job().troubles.size(), 1U);
  EXPECT_EQ(job().troubles[0].message, before[0].message);
  EXPECT_EQ(job().troubles[0].workers, before[0].workers);
  EXPECT_EQ(job().stages[0].disputed.size(), 1U);
  check_queue(cluster_.queue, cluster_.now);
  first_.sync(1);  // whoever gave one of the two results is not asked
  second_.sync(1);
  for (const QueueWorker* const worker : {&first_, &second_}) {
    for (const AssignAction& assign : worker->held) {
      EXPECT_NE(assign.purpose, Purpose::kAudit);
    }
  }
  work(third_);
  EXPECT_TRUE(cluster_.queue.is_liar("first", all_stages()[0]));
  EXPECT_FALSE(cluster_.queue.is_liar("second", all_stages()[0]));
  EXPECT_EQ(job().troubles[0].liar, "first");
}

TEST_F(QueueAudits, ALiarThatWasFound_IsToldAfterARestart) {
  cluster_.submit("a", {1, 4});
  first_.sync(1);
  cluster_.apply(DisconnectEvent{"first"});
  second_.sync(1);
  second_.finish();
  second_.sync();
  first_.finish(1'000, ~std::uint64_t{0}, "a lie");
  first_.sync();
  third_.sync(1);
  for (int turn = 0; turn < 5 && job().troubles[0].liar.empty(); ++turn) {
    third_.finish();
    third_.sync(1);
  }
  ASSERT_FALSE(job().has_ended());
  const std::vector<Trouble> before = job().troubles;
  ASSERT_EQ(before[0].liar, "first");
  cluster_.restart();
  ASSERT_EQ(job().troubles.size(), 1U);
  EXPECT_EQ(job().troubles[0].message, before[0].message);
  EXPECT_EQ(job().troubles[0].liar, "first");
  EXPECT_TRUE(job().stages[0].disputed.empty());
  EXPECT_TRUE(job().open_mismatches.empty());
}

// Found by a seed of tests/simulation.
TEST(QueueDisputedAudits, AnAuditOfTwoDisputedShards_LeavesTheSecondToOthersWhenTheJobBeginsAgain) {
  QueueCluster cluster;
  QueueWorker late(cluster, "late", 2);
  cluster.submit_audited("a", {2, 1}, 1);
  late.sync(1);
  ASSERT_EQ(late.held.at(0).shards, 2U);
  cluster.apply(DisconnectEvent{"late"});
  QueueWorker liar(cluster, "liar", 2);
  for (int turn = 0; turn < 2; ++turn) {
    liar.sync(1);
    liar.finish(1'000, ~std::uint64_t{0}, "a lie");
    liar.sync();
  }
  QueueWorker other(cluster, "other", 2);
  other.sync(1);
  ASSERT_EQ(other.held.at(0).purpose, Purpose::kAudit);
  ASSERT_EQ(other.held[0].shards, 2U);
  late.finish();
  late.sync();  // otherwise than the liar, of both
  ASSERT_EQ(cluster.queue.disputes().size(), 2U);
  cluster.restart();
  ASSERT_EQ(cluster.queue.disputes().size(), 2U);
  for (int turn = 0; turn < 30 && !cluster.job("a").has_ended(); ++turn) {
    for (QueueWorker* const worker : {&other, &late}) {
      while (!worker->held.empty()) {
        worker->finish();
      }
      worker->sync(1);
    }
    cluster.advance(1'000);
    check_queue(cluster.queue, cluster.now);
  }
  EXPECT_EQ(cluster.job("a").phase, JobPhase::kSucceeded) << cluster.job("a").error;
  EXPECT_TRUE(cluster.queue.is_liar("liar", all_stages()[0]));
}

}  // namespace
}  // namespace weft::coordinator
