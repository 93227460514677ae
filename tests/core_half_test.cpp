#include <bit>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/half.h"

namespace weft::core {
namespace {

// The same in integer arithmetic.
std::uint16_t half_by_integers(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const auto sign = static_cast<std::uint16_t>(bits >> 16 & 0x8000U);
  const std::uint32_t magnitude = bits & 0x7fffffffU;
  if (magnitude > 0x7f800000U) {
    return static_cast<std::uint16_t>(sign | 0x7e00U);  // not a number
  }
  if (magnitude >= 0x477ff000U) {
    return static_cast<std::uint16_t>(sign | 0x7c00U);  // rounds up to 2^16 or more
  }
  if (magnitude < 0x33000000U) {
    return sign;  // below half of the smallest subnormal, 2^-24
  }
  const std::uint32_t exponent = magnitude >> 23;
  std::uint32_t mantissa = magnitude & 0x7fffffU;
  std::uint32_t shift = 13;
  std::uint32_t base = 0;
  if (exponent < 113) {  // subnormal half: the leading one becomes explicit
    mantissa |= 0x800000U;
    shift = 126 - exponent;
  } else {
    base = (exponent - 112) << 10;
  }
  const std::uint32_t remainder = mantissa & ((1U << shift) - 1U);
  const std::uint32_t tie = 1U << (shift - 1U);
  std::uint32_t result = base + (mantissa >> shift);  // a carry moves to the next exponent
  if (remainder > tie || (remainder == tie && (result & 1U) != 0)) {
    ++result;
  }
  return static_cast<std::uint16_t>(sign | result);
}

float float_by_integers(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000U) << 16;
  const std::uint32_t exponent = half >> 10 & 0x1fU;
  const std::uint32_t mantissa = half & 0x3ffU;
  if (exponent == 0) {  // exact: at most ten bits, scaled by a power of two
    const float value = static_cast<float>(mantissa) * 0x1p-24F;
    return sign != 0 ? -value : value;
  }
  const std::uint32_t wide = exponent == 31 ? 0xffU : exponent + 112;
  return std::bit_cast<float>(sign | wide << 23 | mantissa << 13);
}

TEST(Half, EveryHalfSurvivesTheWayThroughFloat) {
  for (std::uint32_t bits = 0; bits < 0x10000; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    const float value = float_from_half(half);
    if (std::isnan(value)) {
      EXPECT_TRUE(std::isnan(float_by_integers(half))) << bits;
      EXPECT_EQ(half_from_float(value), half_by_integers(value)) << bits;
    } else {
      EXPECT_EQ(half_from_float(value), half) << bits;
      EXPECT_EQ(std::bit_cast<std::uint32_t>(value),
                std::bit_cast<std::uint32_t>(float_by_integers(half)))
          << bits;
    }
  }
}

TEST(Half, AgreesWithIntegersOnAMillionFloats) {
  std::uint32_t bits = 1;
  for (int i = 0; i < 1'000'000; ++i) {
    bits = bits * 1664525U + 1013904223U;
    // Exponents from 2^-27 to 2^17: subnormal, normal and overflowing halves.
    const std::uint32_t exponent = 100 + (bits >> 8) % 45;
    const auto value = std::bit_cast<float>((bits & 0x807fffffU) | exponent << 23);
    ASSERT_EQ(half_from_float(value), half_by_integers(value)) << value;
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
