#include <atomic>
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

TEST(Parallel, WhatHelpersUseIsCountedAndTheirFloatModeIsTheCallers) {
  constexpr unsigned kFlush = 0x8040;  // flush to zero, denormals are zero
  const unsigned before = _mm_getcsr();
  _mm_setcsr(before | kFlush);
  std::atomic<int> of_other_mode{0};
  const double own_before = thread_cpu_seconds();
  const double all_before = process_cpu_seconds();
  in_parallel(
      4,
      [&](std::size_t) {
        of_other_mode += (_mm_getcsr() & kFlush) == kFlush ? 0 : 1;
        volatile double sum = 0;
        for (int i = 0; i < 2'000'000; ++i) {
          sum = sum + i;
        }
      },
      4);
  _mm_setcsr(before);
  EXPECT_EQ(of_other_mode, 0);
  // Nobody else works here; threads cost something to start and to end.
  EXPECT_GT(thread_cpu_seconds() - own_before, 0.5 * (process_cpu_seconds() - all_before));
}

}  // namespace
}  // namespace weft::core
