#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "core/moments.h"
#include "core/random.h"

namespace weft::core {
namespace {

TEST(Moments, FixedPointRoundsToTheNearestStep) {
  EXPECT_EQ(to_fixed_point(0), 0);
  EXPECT_EQ(to_fixed_point(1), std::int64_t{1} << 32);
  EXPECT_EQ(to_fixed_point(-0.5), -(std::int64_t{1} << 31));
  EXPECT_EQ(to_fixed_point(0.4 / kFixedPointScale), 0);
  EXPECT_EQ(to_fixed_point(0.6 / kFixedPointScale), 1);
  Random random(3, 0);
  for (int i = 0; i < 1000; ++i) {
    const double value = (2 * random.uniform_double() - 1) * 1000;
    EXPECT_LE(std::fabs(from_fixed_point(to_fixed_point(value)) - value), 0.5 / kFixedPointScale);
  }
}

// What floating point does not do: the same sum in any order and any grouping.
TEST(Moments, SumsDoNotDependOnHowTheyAreSplit) {
  Random random(5, 0);
  std::vector<double> values(10'000);
  for (double& value : values) {
    value = std::exp(20 * random.uniform_double() - 14);
  }
  std::int64_t forwards = 0;
  for (const double value : values) {
    forwards += to_fixed_point(value);
  }
  std::int64_t backwards_in_blocks = 0;
  for (std::size_t end = values.size(); end > 0; end -= 100) {
    std::int64_t block = 0;
    for (std::size_t i = end - 100; i < end; ++i) {
      block += to_fixed_point(values[i]);
    }
    backwards_in_blocks += block;
  }
  EXPECT_EQ(forwards, backwards_in_blocks);
}

TEST(Moments, MeanAndErrorOfKnownNumbers) {
  // 1, 2, 3, 4: mean 2.5, variance 5/3.
  const MeanAndError known = mean_and_error(10, 30, 4);
  EXPECT_DOUBLE_EQ(known.mean, 2.5);
  EXPECT_DOUBLE_EQ(known.standard_error, std::sqrt(5.0 / 3.0 / 4.0));
}

TEST(Moments, NoSamplesAndOneSampleHaveNoError) {
  EXPECT_EQ(mean_and_error(0, 0, 0).mean, 0);
  EXPECT_EQ(mean_and_error(0, 0, 0).standard_error, 0);
  EXPECT_EQ(mean_and_error(3, 9, 1).mean, 3);
  EXPECT_EQ(mean_and_error(3, 9, 1).standard_error, 0);
}

TEST(Moments, EqualSamplesHaveNoErrorEvenWhereRoundingMakesTheVarianceNegative) {
  const double value = 0.1;
  const double count = 3;
  const double squares = std::nextafter(count * value * value, 0.0);
  EXPECT_EQ(mean_and_error(count * value, squares, count).standard_error, 0);
}

// 1,000 experiments: the mean of n uniform numbers lies within 2.576 standard errors of 1/2 in 99
// %. The number of misses is binomial with p = 0.01: below 3 or above 19 with a chance of 0.6 %.
TEST(Moments, StandardErrorCoversTheTrueMeanAsOftenAsItSays) {
  int misses = 0;
  for (std::uint32_t experiment = 0; experiment < 1000; ++experiment) {
    Random random(11, experiment);
    double sum = 0;
    double squares = 0;
    for (int i = 0; i < 1000; ++i) {
      const double x = random.uniform_double();
      sum += x;
      squares += x * x;
    }
    const MeanAndError result = mean_and_error(sum, squares, 1000);
    misses += std::fabs(result.mean - 0.5) > 2.576 * result.standard_error ? 1 : 0;
  }
  EXPECT_GE(misses, 3);
  EXPECT_LE(misses, 19);
}

}  // namespace
}  // namespace weft::core
