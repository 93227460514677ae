#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "core/moments.h"
#include "core/stopping.h"

namespace weft::core {
namespace {

// Sums over samples of two numbers, each sample once.
struct TwoNumbers {
  std::vector<std::int64_t> sum = {0, 0};
  std::vector<std::int64_t> sum_of_squares = {0, 0};
  std::uint64_t paths = 0;

  void add(double first, double second) {
    const double values[] = {first, second};
    for (std::size_t i = 0; i < 2; ++i) {
      sum[i] += to_fixed_point(values[i]);
      sum_of_squares[i] += to_fixed_point(values[i] * values[i]);
    }
    ++paths;
  }
  [[nodiscard]] PathSums sums() const { return {sum, sum_of_squares, paths}; }
};

TwoNumbers coin_and_constant(std::uint64_t paths) {
  TwoNumbers numbers;
  for (std::uint64_t i = 0; i < paths; ++i) {
    numbers.add(i % 2 == 0 ? 1 : -1, 3);
  }
  return numbers;
}

TEST(Stopping, ErrorIsTheRootMeanSquareOverTheNumbers) {
  // A fair coin's standard error is 1 / sqrt(n - 1), a constant's is 0.
  const TwoNumbers numbers = coin_and_constant(4096);
  EXPECT_NEAR(root_mean_square_error(numbers.sums()), std::sqrt(1.0 / 4095 / 2), 1e-12);
  EXPECT_EQ(root_mean_square_error({}), 0);
}

TEST(Stopping, EndsAtWholeBlocksFromTheFourthOnThatReachTheTarget) {
  const StoppingRule easy{1, 10'000};
  for (const std::uint64_t paths : {256, 512, 768, 1023, 1025, 1200, 9999}) {
    EXPECT_FALSE(ends_at(easy, coin_and_constant(paths).sums())) << paths;
  }
  for (const std::uint64_t paths : {1024, 1280, 9216}) {
    EXPECT_TRUE(ends_at(easy, coin_and_constant(paths).sums())) << paths;
  }
  const double reached = root_mean_square_error(coin_and_constant(6144).sums());
  const StoppingRule at_six{reached, 10'000};
  EXPECT_FALSE(ends_at(at_six, coin_and_constant(6144 - 256).sums()));
  EXPECT_TRUE(ends_at(at_six, coin_and_constant(6144).sums()));
  EXPECT_FALSE(ends_at({std::nextafter(reached, 0.0), 10'000}, coin_and_constant(6144).sums()));
}

TEST(Stopping, EndsAtTheBoundWhateverTheErrorAndNeverBeyond) {
  for (const std::uint64_t most : {1, 700, 1024, 5000}) {
    EXPECT_TRUE(ends_at({1e-9, most}, coin_and_constant(most).sums())) << most;
    EXPECT_FALSE(ends_at({1, most}, coin_and_constant(most + 1).sums())) << most;
  }
}

TEST(Stopping, EndsWhereMoreMightNotFit) {
  const StoppingRule rule{1e-9, kMostStoppingPaths};
  for (const std::int64_t sign : {1, -1}) {
    TwoNumbers numbers = coin_and_constant(8192);
    numbers.sum[1] = sign * ((std::int64_t{1} << 62) - 1);
    EXPECT_FALSE(ends_at(rule, numbers.sums()));
    numbers.sum[1] += sign;
    EXPECT_TRUE(ends_at(rule, numbers.sums()));
  }
  TwoNumbers numbers = coin_and_constant(8192);
  numbers.sum_of_squares[0] = std::int64_t{1} << 62;
  EXPECT_TRUE(ends_at(rule, numbers.sums()));
}

}  // namespace
}  // namespace weft::core
