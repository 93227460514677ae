#include <gtest/gtest.h>

#include "coordinator/scheduler/census.h"
#include "tests/coordinator_page_fixture.h"
#include "tests/queue_cluster.h"

namespace weft::coordinator {
namespace {

TEST(Census, CountsWhatWaitsAndWhatCouldWork) {
  QueueCluster cluster;
  QueueWorker worker(cluster, "w", 1);
  cluster.submit("a", {3});
  Census census = census_of(cluster.queue, cluster.now);
  EXPECT_EQ(census.jobs_queued, 1U);
  worker.sync(1);
  census = census_of(cluster.queue, cluster.now);
  const Census::Shards geometry = census.shards.at(StageName::kGeometry);
  EXPECT_EQ(geometry.waiting + geometry.running, 3U);
  EXPECT_GT(geometry.running, 0U);
  EXPECT_EQ(census.runnable_shards, 3U);
  EXPECT_EQ(census.jobs_running, 1U);
  EXPECT_EQ(census.workers_live, 1U);
  EXPECT_EQ(census.workers_idle, 0U);
  EXPECT_EQ(census.threads, 1U);
  // Nobody shall start workers for what a person has stopped.
  cluster.apply(PauseEvent{"a", true});
  census = census_of(cluster.queue, cluster.now);
  EXPECT_EQ(census.jobs_paused, 1U);
  EXPECT_EQ(census.runnable_shards, 0U);
  EXPECT_EQ(census.work_seconds, 0);
}

TEST_F(PageTest, MetricsCountWhatHappened) {
  EXPECT_EQ(figure("weft_attempts_total{outcome=\"succeeded\"}"), 0);
  EXPECT_EQ(figure("weft_jobs_ended_total{state=\"succeeded\"}"), 0);
  ASSERT_TRUE(submit("waits", small_description("other")).ok());
  EXPECT_EQ(figure("weft_jobs{state=\"queued\"}"), 1);
  const v1::Job ended = publish("r1");
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error();
  const auto attempts = static_cast<double>(
      json("/api/jobs/" + ended.id() + "/attempts?limit=1000")["attempts"].size());
  EXPECT_GE(figure("weft_attempts_total{outcome=\"succeeded\"}"), attempts);
  EXPECT_EQ(figure("weft_attempt_seconds_count{stage=\"basis\"}") > 0, true);
  EXPECT_GE(figure("weft_jobs_ended_total{state=\"succeeded\"}"), 1);
  EXPECT_GT(figure("weft_results_total"), 0);
  EXPECT_GT(figure("weft_result_bytes_total"), 0);
  EXPECT_GT(figure("weft_store_bytes{store=\"journal\"}"), 0);
  EXPECT_GT(figure("weft_disk_free_bytes"), 0);
  EXPECT_EQ(figure("weft_coordinator_healthy"), 1);
  EXPECT_EQ(figure("weft_queue_runnable_shards") >= 0, true);
  open({});  // which counts anew what is on the disk
  while (figure("weft_store_bytes{store=\"results\"}") <= 0) {
    std::this_thread::yield();  // counted in a thread of its own
  }
  EXPECT_GT(figure("weft_page_requests_total{status=\"200\"}"), 0);
}

TEST_F(PageTest, MetricsAreInPrometheusFormat) {
  const httplib::Response response = get("/metrics");
  EXPECT_EQ(response.get_header_value("Content-Type"), "text/plain; version=0.0.4; charset=utf-8");
  std::istringstream lines(response.body);
  int series = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.starts_with("# HELP weft_") || line.starts_with("# TYPE weft_")) {
      continue;
    }
    ++series;
    EXPECT_TRUE(line.starts_with("weft_")) << line;
    EXPECT_NE(line.rfind(' '), std::string::npos) << line;
    EXPECT_NO_THROW((void)std::stod(line.substr(line.rfind(' ') + 1))) << line;
  }
  EXPECT_GT(series, 50);
}

}  // namespace
}  // namespace weft::coordinator
