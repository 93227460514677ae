#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/parallel.h"

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

}  // namespace
}  // namespace weft::core
