#include <gtest/gtest.h>

#include "coordinator/scheduler/waiting_calls.h"

namespace weft::coordinator {
namespace {

using Ms = std::chrono::milliseconds;

WaitingCalls::Call call(const std::string& worker, int deadline_ms, std::uint32_t free = 0,
                        const std::vector<std::uint64_t>& running = {}) {
  WaitingCalls::Call call;
  call.report.worker = worker;
  call.report.free_attempts = free;
  for (const std::uint64_t attempt : running) {
    call.report.running.push_back({"j", attempt, "token", 0, 0, {}});
  }
  call.deadline = Time(Ms(deadline_ms));
  return call;
}

TEST(WaitingCalls, Deadlines_ComeInTheirOrder) {
  WaitingCalls calls;
  EXPECT_FALSE(calls.first_deadline().has_value());
  calls.keep(call("a", 30));
  calls.keep(call("b", 10));
  calls.keep(call("c", 20));
  EXPECT_EQ(calls.first_deadline(), Time(Ms(10)));
  EXPECT_FALSE(calls.next_due(Time(Ms(9))).has_value());
  EXPECT_EQ(calls.next_due(Time(Ms(20))), "b");
  EXPECT_TRUE(calls.take("b").has_value());
  EXPECT_EQ(calls.next_due(Time(Ms(20))), "c");
  EXPECT_TRUE(calls.take("c").has_value());
  EXPECT_FALSE(calls.next_due(Time(Ms(20))).has_value());
  EXPECT_FALSE(calls.take("c").has_value());
  EXPECT_EQ(calls.size(), 1U);
}

TEST(WaitingCalls, EndedAttempt_ConcernsThoseWhoListIt) {
  WaitingCalls calls;
  calls.keep(call("a", 10, 0, {7, 8}));
  calls.keep(call("b", 10, 0, {8}));
  calls.keep(call("c", 10, 1, {9}));
  EXPECT_FALSE(calls.has_concerned());
  calls.attempt_ended(6);
  EXPECT_FALSE(calls.has_concerned());
  calls.attempt_ended(8);
  EXPECT_EQ(calls.next_concerned(), "a");
  EXPECT_EQ(calls.next_concerned(), "b");
  EXPECT_FALSE(calls.next_concerned().has_value());
  calls.take("a");
  calls.attempt_ended(7);  // nobody lists it any more
  EXPECT_FALSE(calls.has_concerned());
}

TEST(WaitingCalls, HungryOnes_TakeTurns) {
  WaitingCalls calls;
  calls.keep(call("busy", 10));
  EXPECT_FALSE(calls.next_hungry().has_value());
  calls.keep(call("z", 10, 1));
  calls.keep(call("a", 10, 2));
  WaitingCalls::Call with_completion = call("m", 10);
  with_completion.report.completions.emplace_back();  // it could not be judged yet
  calls.keep(std::move(with_completion));
  EXPECT_EQ(calls.hungry(), 3U);
  EXPECT_EQ(calls.next_hungry(), "z");
  EXPECT_EQ(calls.next_hungry(), "a");
  calls.take("a");
  calls.keep(call("a", 10, 1));  // it called again: it comes last
  EXPECT_EQ(calls.next_hungry(), "m");
  EXPECT_EQ(calls.next_hungry(), "z");
  EXPECT_EQ(calls.next_hungry(), "a");
  EXPECT_EQ(calls.take_all().size(), 4U);
  EXPECT_EQ(calls.hungry(), 0U);
  EXPECT_EQ(calls.size(), 0U);
}

}  // namespace
}  // namespace weft::coordinator
