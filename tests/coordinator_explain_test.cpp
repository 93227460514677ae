#include <gtest/gtest.h>

#include "coordinator/queue/explain.h"
#include "tests/queue_cluster.h"

namespace weft::coordinator {
namespace {

class Explain : public testing::Test {
 protected:
  v1::ExplainResponse of_job(const std::string& id = "a") {
    return explain_job(cluster_.queue, cluster_.job(id), cluster_.now);
  }
  v1::ExplainResponse of_task(std::uint64_t shard, const std::string& stage = "geometry") {
    return explain_task(cluster_.queue, cluster_.job("a"), stage, shard, cluster_.now);
  }
  v1::ExplainResponse of_worker(const std::string& id = "w") {
    return explain_worker(cluster_.queue, cluster_.queue.workers().at(id), cluster_.now);
  }
  static const v1::Reason* find(const v1::ExplainResponse& response, const std::string& code) {
    for (const v1::Reason& reason : response.reasons()) {
      if (reason.code() == code) {
        return &reason;
      }
    }
    return nullptr;
  }

  QueueCluster cluster_;
  QueueWorker worker_{cluster_, "w", 1};
};

TEST_F(Explain, JobWithoutWorkers_SaysHowToStartOne) {
  cluster_.submit("a", {1});
  const v1::ExplainResponse response = of_job();
  ASSERT_NE(find(response, reason::kNoWorker), nullptr);
  EXPECT_NE(find(response, reason::kNoWorker)->mend().find("weft-worker"), std::string::npos);
  EXPECT_EQ(response.subject(), "job a");
  EXPECT_EQ(response.verdict().rfind("waits: ", 0), 0U) << response.verdict();
}

TEST_F(Explain, RunningJob_SaysWhatRunsWhere) {
  cluster_.submit("a", {2});
  worker_.sync(1);
  const v1::ExplainResponse response = of_job();
  EXPECT_EQ(response.verdict(), "runs 1 shard of geometry on 1 worker");
  ASSERT_NE(find(response, reason::kWorkersBusy), nullptr);
  EXPECT_EQ(find(of_task(0), reason::kRunning)->text().rfind("it runs on w ", 0), 0U);
  EXPECT_EQ(of_worker().verdict(), "runs 1 attempt");
}

TEST_F(Explain, PausedJob_SaysHowToResumeIt) {
  worker_.sync();
  cluster_.submit("a", {2});
  cluster_.apply(PauseEvent{"a", true});
  EXPECT_EQ(of_job().reasons(0).code(), reason::kPaused);
  EXPECT_EQ(of_job().reasons(0).mend(), "weft resume a");
  EXPECT_NE(find(of_task(0), reason::kPaused), nullptr);
  EXPECT_NE(find(of_worker(), reason::kNoWork), nullptr);
}

TEST_F(Explain, ShardThatFailed_SaysUntilWhenItWaits) {
  cluster_.submit("a", {1});
  worker_.sync(1);
  worker_.fail("it burns");
  worker_.sync(1);
  const v1::ExplainResponse response = of_job();
  ASSERT_NE(find(response, reason::kRetry), nullptr) << response.DebugString();
  EXPECT_EQ(find(response, reason::kRetry)->until_ms(),
            (cluster_.now + std::chrono::seconds(1)).time_since_epoch().count());
  EXPECT_NE(find(of_task(0), reason::kRetry)->text().find("it burns"), std::string::npos);
}

TEST_F(Explain, EveryObstacle_HasACodeAndAMend) {
  JobDemands demands;
  demands.labels = {"gpu"};
  cluster_.submit("a", {1}, "", {}, demands);
  worker_.sync(1);
  EXPECT_NE(find(of_job(), reason::kLabels), nullptr);
  EXPECT_NE(find(of_worker(), reason::kLabels), nullptr);
  worker_.says().labels = {"gpu"};
  cluster_.apply(DrainEvent{"w", true});
  worker_.sync(1);
  ASSERT_NE(find(of_job(), reason::kDrained), nullptr);
  EXPECT_EQ(find(of_job(), reason::kDrained)->worker(), "w");
  EXPECT_NE(find(of_worker(), reason::kDrained), nullptr);
  cluster_.apply(DrainEvent{"w", false});
  // The last worker is never blocked silently.
  cluster_.apply(BlockEvent{"w", all_stages()[0], true, false});
  worker_.sync(1);
  ASSERT_NE(find(of_job(), reason::kBlocked), nullptr);
  EXPECT_NE(find(of_job(), reason::kBlocked)->mend().find("weft unblock"), std::string::npos);
  EXPECT_NE(find(of_worker(), reason::kBlocked), nullptr);
  cluster_.apply(BlockEvent{"w", all_stages()[0], false, false});
  worker_.says().wall_left_ms = 10'000;
  worker_.sync(1);
  EXPECT_NE(find(of_job(), reason::kWallTime), nullptr);
  worker_.says().wall_left_ms = 0;
  worker_.sync(1);
  worker_.fail("out of memory", true);
  worker_.sync(1);
  ASSERT_NE(find(of_job(), reason::kBackingOff), nullptr);
  EXPECT_GT(find(of_job(), reason::kBackingOff)->until_ms(), 0);
}

TEST_F(Explain, LostWorker_IsSaidToBeLost) {
  worker_.sync();
  cluster_.advance(31'000);
  EXPECT_NE(find(of_worker(), reason::kLost), nullptr);
}

TEST_F(Explain, WorkersOfOtherNumbers_AreSaidToBeSo) {
  cluster_.submit("a", {1, 2});
  worker_.sync(1);
  worker_.finish();
  worker_.sync(0);
  worker_.leave();
  QueueWorker other(cluster_, "other", 1);
  other.set_fingerprint(core::digest_of("another machine"));
  other.sync(1);
  const v1::ExplainResponse response = of_job();
  ASSERT_NE(find(response, reason::kOtherNumerics), nullptr) << response.DebugString();
  EXPECT_GT(find(response, reason::kOtherNumerics)->until_ms(), 0);
}

TEST_F(Explain, AuditWithoutASecondName_SaysWhenItIsGivenUp) {
  cluster_.submit_audited("a", {1}, 1);
  worker_.sync(1);
  worker_.finish();
  worker_.sync(1);
  const v1::ExplainResponse response = of_job();
  ASSERT_NE(find(response, reason::kAwaitsAudit), nullptr) << response.DebugString();
  EXPECT_GT(find(response, reason::kAwaitsAudit)->until_ms(), 0);
  EXPECT_NE(find(of_task(0), reason::kAwaitsAudit), nullptr);
  EXPECT_NE(find(of_task(0), reason::kDone), nullptr);
}

TEST_F(Explain, QuarantinedShard_NamesItsLog) {
  cluster_.submit("a", {2});
  for (int i = 0; i < 5; ++i) {
    cluster_.advance(25'000);
    worker_.sync(1);
    ASSERT_EQ(worker_.held.size(), 1U);
    worker_.fail("it burns");
    worker_.sync();
  }
  ASSERT_NE(find(of_job(), reason::kQuarantined), nullptr);
  EXPECT_NE(find(of_job(), reason::kQuarantined)->mend().find("--task geometry/0"),
            std::string::npos);
  EXPECT_NE(find(of_task(0), reason::kQuarantined), nullptr);
}

TEST_F(Explain, TaskOfALaterStage_WaitsForTheEarlierOnes) {
  cluster_.submit("a", {1, 1});
  worker_.sync();
  EXPECT_EQ(of_task(0, "visibility").reasons(0).code(), reason::kWaitsForStage);
  EXPECT_NE(of_task(7).verdict().find("no such shard"), std::string::npos);
}

TEST_F(Explain, EqualWorkOfAnotherJob_IsNamed) {
  cluster_.submit("a", {1}, "same");
  cluster_.submit("b", {1}, "same");
  worker_.sync(2);
  ASSERT_EQ(worker_.held.size(), 1U);
  EXPECT_NE(find(of_job("b"), reason::kRunsElsewhere), nullptr);
}

TEST_F(Explain, EveryWaitingJob_HasAReason) {
  cluster_.submit("a", {3});
  for (int turn = 0; turn < 12; ++turn) {
    EXPECT_GT(of_job().reasons_size(), 0) << turn;
    EXPECT_FALSE(of_job().verdict().empty());
    worker_.sync(1);
    if (!worker_.held.empty()) {
      worker_.finish();
      worker_.sync();
    }
    cluster_.advance(500);
  }
}

}  // namespace
}  // namespace weft::coordinator
