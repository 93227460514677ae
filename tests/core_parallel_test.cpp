#include <atomic>
#include <cmath>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <xmmintrin.h>

#include "core/parallel.h"
#include "core/resource_use.h"

namespace weft::core {
namespace {

TEST(Parallel, EveryIndexIsWorkedOnOnce) {
  for (const std::size_t count : {0U, 1U, 2U, 1000U}) {
    std::vector<int> times(count, 0);
    in_parallel(count, [&times](std::size_t i) { ++times[i]; });
    EXPECT_EQ(times, std::vector<int>(count, 1));
  }
}

TEST(Parallel, TheLowestIndexThatFailsIsTold) {
  for (int run = 0; run < 200; ++run) {
    std::atomic<int> done{0};
    try {
      in_parallel(100, [&done](std::size_t i) {
        if (i % 10 == 7) {
          throw std::runtime_error(std::to_string(i));
        }
        ++done;
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "7");
    }
    EXPECT_GE(done, 7) << "what lies before a failure is done";
  }
}

TEST(Parallel, NoMoreThreadsThanAllowedTakePart) {
  std::mutex mutex;
  std::set<std::thread::id> seen;
  in_parallel(
      1000,
      [&](std::size_t) {
        const std::lock_guard lock(mutex);
        seen.insert(std::this_thread::get_id());
      },
      1);
  EXPECT_EQ(seen, std::set{std::this_thread::get_id()});
}

TEST(Parallel, HelpersComputeInTheFloatModeOfTheirCaller) {
  constexpr unsigned kFlush = 0x8040;  // flush to zero, denormals are zero
  const unsigned before = _mm_getcsr();
  _mm_setcsr(before | kFlush);
  std::atomic<int> of_other_mode{0};
  in_parallel(
      100, [&](std::size_t) { of_other_mode += (_mm_getcsr() & kFlush) == kFlush ? 0 : 1; }, 4);
  _mm_setcsr(before);
  EXPECT_EQ(of_other_mode, 0);
}

// Each index claims a day of CPU time for its thread: whoever took it, the caller has it in the
// end.
TEST(Parallel, WhatHelpersUseCountsAsTheCallers) {
  constexpr double kDay = 86'400;
  const double before = thread_cpu_seconds();
  in_parallel(
      100, [](std::size_t) { add_thread_cpu_seconds(kDay); }, 4);
  EXPECT_EQ(std::floor((thread_cpu_seconds() - before) / kDay), 100);
}

}  // namespace
}  // namespace weft::core
