#include <bit>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <immintrin.h>

#include "core/half.h"

namespace weft::core {
namespace {

TEST(Half, EveryHalfSurvivesTheWayThroughFloat) {
  for (std::uint32_t bits = 0; bits < 0x10000; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    const float value = float_from_half(half);
    if (std::isnan(value)) {
      EXPECT_TRUE(std::isnan(float_from_half(half_from_float(value)))) << bits;
    } else {
      EXPECT_EQ(half_from_float(value), half) << bits;
    }
  }
}

TEST(Half, AgreesWithTheProcessorOnAMillionFloats) {
  std::uint32_t bits = 1;
  for (int i = 0; i < 1'000'000; ++i) {
    bits = bits * 1664525U + 1013904223U;
    // Exponents from 2^-27 to 2^17: subnormal, normal and overflowing halves.
    const std::uint32_t exponent = 100 + (bits >> 8) % 45;
    const auto value = std::bit_cast<float>((bits & 0x807fffffU) | exponent << 23);
    ASSERT_EQ(half_from_float(value), _cvtss_sh(value, _MM_FROUND_TO_NEAREST_INT)) << value;
  }
}

TEST(Half, RoundsTiesToEvenAndOverflowsToInfinity) {
  EXPECT_EQ(half_from_float(1.0F), 0x3c00);
  EXPECT_EQ(half_from_float(1.0F + 0x1p-11F), 0x3c00);
  EXPECT_EQ(half_from_float(1.0F + 3 * 0x1p-11F), 0x3c02);
  EXPECT_EQ(half_from_float(65504.0F), 0x7bff);
  EXPECT_EQ(half_from_float(65520.0F), 0x7c00);
  EXPECT_EQ(half_from_float(-0x1p-25F), 0x8000);
  EXPECT_EQ(half_from_float(-std::numeric_limits<float>::infinity()), 0xfc00);
}

}  // namespace
}  // namespace weft::core
