#include <gtest/gtest.h>

#include "cli/message_json.h"
#include "cli/present.h"

// What is said of jobs and workers in words.

namespace weft::cli {
namespace {

TEST(Present, GivenUpAudits_AreSaidOfAJob) {
  v1::Job job;
  EXPECT_EQ(audits_text(job), "");
  job.set_audits_given_up(1);
  EXPECT_EQ(audits_text(job), "1 result was not confirmed: no second worker could do it");
  job.set_audits_given_up(7);
  EXPECT_EQ(audits_text(job), "7 results were not confirmed: no second worker could do it");
  EXPECT_EQ(to_json(job).at("audits_given_up").get<int>(), 7);
}

TEST(Present, AWorkerThatCannotDeliver_IsSaidToBeSo) {
  v1::Worker worker;
  EXPECT_EQ(condition_text(worker), "live");
  worker.set_undelivered("no room");
  worker.set_drained(true);
  EXPECT_EQ(condition_text(worker), "live, drained, cannot deliver");
}

}  // namespace
}  // namespace weft::cli
