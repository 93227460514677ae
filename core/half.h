#pragma once

#include <bit>
#include <cstdint>

namespace weft::core {

// IEEE 754 binary16 as raw bits, from and to float, in integer arithmetic: the same bits on every
// machine. Rounds to nearest, ties to even; what exceeds 65504 becomes infinity.
[[nodiscard]] constexpr std::uint16_t half_from_float(float value) {
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

[[nodiscard]] constexpr float float_from_half(std::uint16_t half) {
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

}  // namespace weft::core
