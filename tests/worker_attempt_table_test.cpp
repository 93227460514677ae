#include <string>

#include <gtest/gtest.h>

#include "proto/limits.h"
#include "worker/attempt_table.h"

namespace weft::worker {
namespace {

v1::Assignment run_of(std::uint64_t attempt, std::uint64_t first_shard, std::uint64_t shards) {
  v1::Assignment assignment;
  assignment.mutable_name()->set_job_id("j1");
  assignment.mutable_name()->set_attempt(attempt);
  assignment.set_lease_token("token" + std::to_string(attempt));
  assignment.set_shard_count(100);
  assignment.set_first_shard(first_shard);
  assignment.set_shards(shards);
  return assignment;
}

v1::SynchronizeResponse giving(const v1::Assignment& assignment) {
  v1::SynchronizeResponse response;
  *response.add_assignments() = assignment;
  return response;
}

v1::SynchronizeResponse stopping(std::uint64_t attempt) {
  v1::SynchronizeResponse response;
  response.add_stop()->set_job_id("j1");
  response.mutable_stop(0)->set_attempt(attempt);
  return response;
}

v1::SynchronizeResponse acknowledging(std::uint64_t attempt) {
  v1::SynchronizeResponse response;
  response.add_acknowledged()->set_job_id("j1");
  response.mutable_acknowledged(0)->set_attempt(attempt);
  return response;
}

v1::SynchronizeRequest request_of(const AttemptTable& table) {
  v1::SynchronizeRequest request;
  table.fill(request);
  return request;
}

v1::ShardResult result_of(std::uint64_t shard) {
  v1::ShardResult result;
  result.set_shard(shard);
  return result;
}

TEST(AttemptTable, ClaimsEveryShardOnceInOrderAndCompletesTheAttempt) {
  AttemptTable table(2);
  EXPECT_EQ(table.apply(giving(run_of(7, 10, 3))).assigned.size(), 1U);
  for (std::uint64_t shard = 10; shard < 13; ++shard) {
    const auto claim = table.claim();
    ASSERT_TRUE(claim);
    EXPECT_EQ(claim->shard, shard);
    EXPECT_EQ(request_of(table).running_size(), 1);
    EXPECT_EQ(table.delivered(*claim, result_of(shard)), shard == 12);
  }
  EXPECT_FALSE(table.claim());
  const v1::SynchronizeRequest request = request_of(table);
  EXPECT_EQ(request.running_size(), 0);
  ASSERT_EQ(request.completions_size(), 1);
  EXPECT_EQ(request.completions(0).attempt(), 7U);
  EXPECT_EQ(request.completions(0).lease_token(), "token7");
  EXPECT_EQ(request.completions(0).results_size(), 3);
  EXPECT_FALSE(request.completions(0).has_error());
}

TEST(AttemptTable, RepeatsACompletionUntilItIsAcknowledged) {
  AttemptTable table(1);
  table.apply(giving(run_of(1, 0, 1)));
  table.delivered(*table.claim(), result_of(0));
  for (int call = 0; call < 3; ++call) {
    EXPECT_EQ(request_of(table).completions_size(), 1);
    table.apply(v1::SynchronizeResponse());
  }
  EXPECT_EQ(table.apply(acknowledging(1)).acknowledged, 1U);
  EXPECT_TRUE(table.is_empty());
}

TEST(AttemptTable, AnAssignmentThatComesAgainIsNotRunTwice) {
  AttemptTable table(1);
  EXPECT_EQ(table.apply(giving(run_of(1, 0, 1))).assigned.size(), 1U);
  EXPECT_EQ(table.apply(giving(run_of(1, 0, 1))).assigned.size(), 0U);
  table.delivered(*table.claim(), result_of(0));
  EXPECT_EQ(table.apply(giving(run_of(1, 0, 1))).assigned.size(), 0U);
  EXPECT_FALSE(table.claim());
}

TEST(AttemptTable, ARevokedAttemptStopsAndStillGivesWhatItHadFinished) {
  AttemptTable table(2);
  table.apply(giving(run_of(1, 0, 4)));
  const auto first = table.claim();
  const auto second = table.claim();
  table.delivered(*first, result_of(0));
  EXPECT_EQ(table.apply(stopping(1)).revoked.size(), 1U);
  EXPECT_TRUE(second->attempt->should_stop.load());
  EXPECT_FALSE(table.claim()) << "nothing more of it is begun";
  EXPECT_EQ(request_of(table).running_size(), 0);
  EXPECT_TRUE(table.given_up(*second));
  ASSERT_EQ(request_of(table).completions_size(), 1);
  EXPECT_EQ(request_of(table).completions(0).results_size(), 1);
}

TEST(AttemptTable, ARevokedAttemptWithoutResultsIsForgotten) {
  AttemptTable table(1);
  table.apply(giving(run_of(1, 0, 4)));
  const auto claim = table.claim();
  table.apply(stopping(1));
  EXPECT_FALSE(table.is_empty()) << "a shard of it still runs";
  table.given_up(*claim);
  EXPECT_TRUE(table.is_empty());
}

TEST(AttemptTable, AFailureEndsTheAttemptWithTheFirstErrorAndTheFinishedShards) {
  AttemptTable table(3);
  table.apply(giving(run_of(1, 5, 4)));
  const auto a = table.claim();
  const auto b = table.claim();
  const auto c = table.claim();
  table.delivered(*a, result_of(5));
  v1::TaskError error;
  error.set_kind(v1::ERROR_KIND_TASK_FAILED);
  error.set_shard(6);
  error.set_message("first");
  EXPECT_FALSE(table.failed(*b, error)) << "shard 7 still runs";
  EXPECT_TRUE(c->attempt->should_stop.load());
  error.set_shard(7);
  error.set_message("second");
  EXPECT_TRUE(table.failed(*c, error));
  const v1::SynchronizeRequest request = request_of(table);
  ASSERT_EQ(request.completions_size(), 1);
  EXPECT_EQ(request.completions(0).error().shard(), 6U);
  EXPECT_EQ(request.completions(0).error().message(), "first");
  EXPECT_EQ(request.completions(0).results_size(), 1);
}

TEST(AttemptTable, AMalformedAssignmentIsCompletedWithAnError) {
  v1::Assignment outside = run_of(1, 99, 2);
  v1::Assignment empty = run_of(2, 0, 0);
  v1::Assignment wraps = run_of(3, 50, ~std::uint64_t{0});
  v1::Assignment unnamed = run_of(4, 0, 1);
  unnamed.add_inputs("not a digest");
  v1::Assignment uneven = run_of(5, 0, 2);
  uneven.add_shard_inputs(std::string(32, 'x'));
  AttemptTable table(1);
  for (const v1::Assignment& assignment : {outside, empty, wraps, unnamed, uneven}) {
    table.apply(giving(assignment));
    EXPECT_FALSE(table.claim());
  }
  const v1::SynchronizeRequest request = request_of(table);
  ASSERT_EQ(request.completions_size(), 5);
  for (const v1::Completion& completion : request.completions()) {
    EXPECT_EQ(completion.error().kind(), v1::ERROR_KIND_TASK_FAILED);
    EXPECT_NE(completion.error().message(), "");
  }
}

TEST(AttemptTable, TakesOneRunToWorkOnAndOneToGoOnWith) {
  AttemptTable table(4);
  EXPECT_EQ(table.free_attempts(), 2U);
  table.apply(giving(run_of(1, 0, 1)));
  EXPECT_EQ(table.free_attempts(), 1U);
  table.apply(giving(run_of(2, 1, 8)));
  EXPECT_EQ(table.free_attempts(), 0U);
  (void)table.claim();
  EXPECT_EQ(table.free_attempts(), 1U) << "the first run is all begun and leaves threads free";
}

TEST(AttemptTable, HoldsNoMoreAttemptsThanThreadsAndOne) {
  AttemptTable table(2);
  for (std::uint64_t attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_GT(table.free_attempts(), 0U);
    table.apply(giving(run_of(attempt, attempt, 1)));
    (void)table.claim();
  }
  EXPECT_EQ(table.free_attempts(), 0U);
}

TEST(AttemptTable, DrainingBeginsNothingAndReportsWhatIsDone) {
  AttemptTable table(2);
  table.apply(giving(run_of(1, 0, 3)));
  table.apply(giving(run_of(2, 3, 3)));
  const auto done = table.claim();
  const auto running = table.claim();
  table.delivered(*done, result_of(0));
  table.drain();
  EXPECT_FALSE(table.claim());
  EXPECT_EQ(table.free_attempts(), 0U);
  EXPECT_TRUE(running->attempt->should_stop.load());
  EXPECT_TRUE(table.given_up(*running));
  EXPECT_TRUE(table.apply(giving(run_of(3, 6, 3))).assigned.empty());
  const v1::SynchronizeRequest request = request_of(table);
  EXPECT_EQ(request.running_size(), 0);
  ASSERT_EQ(request.completions_size(), 2);
  EXPECT_EQ(request.completions(0).results_size(), 1);
  EXPECT_EQ(request.completions(1).results_size(), 0);
}

TEST(AttemptTable, AnAttemptOfADeadProcessIsReportedWithItsOldTokenButNeverListedAsRunning) {
  AttemptTable table(2);
  v1::Completion earlier;
  earlier.set_job_id("j1");
  earlier.set_attempt(5);
  earlier.set_lease_token("old");
  *earlier.add_results() = result_of(3);
  const std::shared_ptr<Attempt> attempt = table.take_over(earlier, 2);
  EXPECT_FALSE(table.claim());
  EXPECT_EQ(request_of(table).running_size(), 0);
  EXPECT_EQ(request_of(table).completions_size(), 0) << "two results are on their way";
  EXPECT_EQ(table.free_attempts(), 2U);
  EXPECT_FALSE(table.delivered({attempt, 4}, result_of(4)));
  EXPECT_TRUE(table.given_up({attempt, 5}));
  ASSERT_EQ(request_of(table).completions_size(), 1);
  EXPECT_EQ(request_of(table).completions(0).lease_token(), "old");
  EXPECT_EQ(request_of(table).completions(0).results_size(), 2);
  EXPECT_TRUE(table.take_forgotten().empty());
  table.apply(acknowledging(5));
  EXPECT_EQ(table.take_forgotten().size(), 1U);
}

TEST(AttemptTable, ARunningAttemptTellsHowFarItIs) {
  AttemptTable table(1);
  table.apply(giving(run_of(1, 0, 2)));
  const auto claim = table.claim();
  claim->attempt->progress.store(17);
  claim->attempt->log.add("half way");
  const v1::SynchronizeRequest request = request_of(table);
  ASSERT_EQ(request.running_size(), 1);
  EXPECT_EQ(request.running(0).progress(), 17U);
  EXPECT_EQ(request.running(0).last_line(), "half way");
}

TEST(AttemptTable, NeverSendsMoreCompletionsThanTheProtocolAllows) {
  AttemptTable table(1);
  const auto limit = static_cast<std::uint64_t>(v1::kCompletionLimit);
  for (std::uint64_t attempt = 1; attempt <= limit + 10; ++attempt) {
    table.apply(giving(run_of(attempt, 0, 1)));
    table.delivered(*table.claim(), result_of(0));
  }
  EXPECT_EQ(request_of(table).completions_size(), v1::kCompletionLimit);
  EXPECT_EQ(table.free_attempts(), 0U) << "no more work while nothing is acknowledged";
}

}  // namespace
}  // namespace weft::worker
