#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/sobol.h"

namespace weft::core {
namespace {

// The first `count` points from `first` on.
std::vector<SobolPoints::Point> points(std::uint64_t seed, std::uint32_t first,
                                       std::uint32_t count) {
  const SobolPoints sequence(seed, 5);
  std::vector<SobolPoints::Point> all;
  for (std::uint32_t i = first; i < first + count; ++i) {
    all.push_back(sequence.point(i));
  }
  return all;
}

TEST(SobolPoints, AnyAlignedPowerOfTwoHasOnePointInEachInterval) {
  for (const std::uint32_t first : {0U, 256U, 1024U, 3U << 20}) {
    const auto some = points(1, first, 256);
    for (std::size_t d = 0; d < SobolPoints::kDimensions; ++d) {
      std::set<std::uint32_t> intervals;
      for (const auto& point : some) {
        intervals.insert(point[d] >> 24);
      }
      EXPECT_EQ(intervals.size(), 256U) << "dimension " << d << " from " << first;
    }
  }
}

// Sobol's first two dimensions are a (0, 2) sequence, and scrambling keeps it one.
TEST(SobolPoints, FirstTwoDimensionsHaveOnePointInEachBoxOfEachShape) {
  const auto some = points(2, 512, 256);
  for (unsigned across = 0; across <= 8; ++across) {
    std::set<std::uint32_t> boxes;
    for (const auto& point : some) {
      const std::uint64_t column = std::uint64_t{point[0]} >> (32 - across);
      const std::uint64_t row = std::uint64_t{point[1]} >> (24 + across);
      boxes.insert(static_cast<std::uint32_t>(column << 16 | row));
    }
    EXPECT_EQ(boxes.size(), 256U) << "2^" << across << " columns";
  }
}

// The published sequence: its differences do not depend on what the scrambling adds at the top bit.
TEST(SobolPoints, SecondPointLiesInTheOtherHalf) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto pair = points(seed, 0, 2);
    for (std::size_t d = 0; d < SobolPoints::kDimensions; ++d) {
      EXPECT_NE(pair[0][d] >> 31, pair[1][d] >> 31);
    }
  }
}

TEST(SobolPoints, EachCoordinateOfAPointIsUniformOverSeeds) {
  constexpr std::size_t kCells = 64;
  constexpr std::uint64_t kSeeds = 16384;
  for (const std::uint32_t index : {0U, 1U, 777U}) {
    std::array<std::array<double, kCells>, SobolPoints::kDimensions> counts{};
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      const SobolPoints::Point point = SobolPoints(seed, 1).point(index);
      for (std::size_t d = 0; d < point.size(); ++d) {
        counts[d][point[d] >> 26] += 1;
      }
    }
    for (const auto& dimension : counts) {
      double chi_square = 0;
      for (const double count : dimension) {
        chi_square += (count - kSeeds / kCells) * (count - kSeeds / kCells) * kCells / kSeeds;
      }
      // 63 degrees of freedom, 0.01 over 18 tests (Sidak: 0.00056).
      EXPECT_LT(chi_square, 106) << "point " << index;
    }
  }
}

TEST(SobolPoints, StreamsAndSeedsDiffer) {
  EXPECT_NE(SobolPoints(1, 1).point(3), SobolPoints(1, 2).point(3));
  EXPECT_NE(SobolPoints(1, 1).point(3), SobolPoints(2, 1).point(3));
  EXPECT_EQ(SobolPoints(1, 1).point(3), SobolPoints(1, 1).point(3));
}

// The mean of a smooth function of all dimensions, over many seeds: right, and far closer to it
// than independent points are.
TEST(SobolPoints, IntegratesSmoothFunctionsWithLessVariance) {
  constexpr std::uint32_t kPoints = 1024;
  constexpr std::uint64_t kSeeds = 200;
  double sum = 0;
  double squares = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    double mean = 0;
    for (const auto& point : points(seed, 0, kPoints)) {
      double product = 1;
      for (const std::uint32_t x : point) {
        product *= 0.5 + x * 0x1p-32;  // mean 1, second moment 13 / 12
      }
      mean += product / kPoints;
    }
    sum += mean;
    squares += (mean - 1) * (mean - 1);
  }
  const double variance = squares / kSeeds;
  EXPECT_LT(variance, 0.02 * (std::pow(13.0 / 12, 6) - 1) / kPoints);
  EXPECT_NEAR(sum / kSeeds, 1, 3 * std::sqrt(variance / kSeeds));
}

}  // namespace
}  // namespace weft::core
