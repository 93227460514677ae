#pragma once

#include <cmath>
#include <cstdint>

namespace weft::core {

// Sums that are the same bytes however they are split and merged: 64-bit fixed point, whose
// addition is associative. 2^-32 resolution leaves 2^31 of range: partial sums over a shard of at
// most 2^20 samples of magnitude below 2^11.
inline constexpr double kFixedPointScale = 0x1p32;

[[nodiscard]] inline std::int64_t to_fixed_point(double value) {
  return static_cast<std::int64_t>(std::nearbyint(value * kFixedPointScale));
}
[[nodiscard]] inline double from_fixed_point(std::int64_t value) {
  return static_cast<double>(value) / kFixedPointScale;
}

// Mean and standard error of the mean from a sum and a sum of squares over `count` samples.
struct MeanAndError {
  double mean = 0;
  double standard_error = 0;
};
[[nodiscard]] inline MeanAndError mean_and_error(double sum, double sum_of_squares, double count) {
  if (count <= 0) {
    return {};
  }
  const double mean = sum / count;
  if (count <= 1) {
    return {mean, 0};
  }
  const double variance = std::fmax(0.0, (sum_of_squares - sum * mean) / (count - 1));
  return {mean, std::sqrt(variance / count)};
}

}  // namespace weft::core
