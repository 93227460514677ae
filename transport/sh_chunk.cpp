#include "transport/sh_chunk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "core/moments.h"

namespace weft::transport {

namespace {

constexpr std::uint32_t kMaxOrder = 8;
constexpr std::size_t kMaxCoefficients = (kMaxOrder + 1) * (kMaxOrder + 1);
constexpr std::size_t kLanes = 8;
constexpr double kLargestChunkSum = 0x1p25;

using Harmonics = std::array<float, kMaxCoefficients + kLanes>;

// K_l^m = sqrt((2l+1)/(4 pi) (l-m)!/(l+m)!), times sqrt 2 for m > 0.
struct Normalisation {
  std::array<std::array<float, kMaxOrder + 1>, kMaxOrder + 1> k{};

  Normalisation() {
    for (std::uint32_t l = 0; l <= kMaxOrder; ++l) {
      for (std::uint32_t m = 0; m <= l; ++m) {
        double ratio = (2.0 * l + 1) / (4 * std::numbers::pi);
        for (std::uint32_t i = l - m + 1; i <= l + m; ++i) {
          ratio /= i;
        }
        k[l][m] = static_cast<float>(std::sqrt(m == 0 ? ratio : 2 * ratio));
      }
    }
  }
};

// Real orthonormal spherical harmonics without the Condon-Shortley phase, j = l (l + 1) + m, by
// recurrences free of trigonometry: C_m + i S_m = (x + i y)^m and Q_l^m = P_l^m / sin^m theta.
void harmonics(glm::vec3 w, std::uint32_t order, Harmonics& y) {
  static const Normalisation normalisation;
  float cosine = 1;
  float sine = 0;
  float q_mm = 1;
  for (std::uint32_t m = 0; m <= order; ++m) {
    float q = q_mm;
    float q_before = 0;
    for (std::uint32_t l = m; l <= order; ++l) {
      const float scaled = normalisation.k[l][m] * q;
      y[l * (l + 1) + m] = scaled * cosine;
      if (m > 0) {
        y[l * (l + 1) - m] = scaled * sine;
      }
      const auto fl = static_cast<float>(l);
      const auto fm = static_cast<float>(m);
      const float next = ((2 * fl + 1) * w.z * q - (fl + fm) * q_before) / (fl + 1 - fm);
      q_before = q;
      q = next;
    }
    const float turned = w.x * cosine - w.y * sine;
    sine = w.x * sine + w.y * cosine;
    cosine = turned;
    q_mm *= 2 * static_cast<float>(m) + 1;
  }
}

}  // namespace

ShChunk::ShChunk(std::uint32_t order)
    : order_(order),
      coefficients_(std::size_t{order + 1} * (order + 1)),
      stride_((coefficients_ + kLanes - 1) / kLanes * kLanes),
      sum_(3 * coefficients_ * stride_),
      sum_of_squares_(3 * coefficients_ * stride_) {
  CHECK_LE(order, kMaxOrder);
}

void ShChunk::add(glm::vec3 weight, glm::vec3 row_direction, glm::vec3 column_direction) {
  if (weight == glm::vec3(0, 0, 0)) {
    return;
  }
  empty_ = false;
  Harmonics rows{};
  Harmonics columns{};  // zero beyond the coefficients, as far as the stride goes
  harmonics(row_direction, order_, rows);
  harmonics(column_direction, order_, columns);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t row = 0; row < coefficients_; ++row) {
      const float scale = weight[static_cast<int>(c)] * rows[row];
      float* sum = &sum_[(c * coefficients_ + row) * stride_];
      float* squares = &sum_of_squares_[(c * coefficients_ + row) * stride_];
      for (std::size_t column = 0; column < stride_; ++column) {
        const float value = scale * columns[column];
        sum[column] += value;
        squares[column] += value * value;
      }
    }
  }
}

void ShChunk::flush(std::span<std::int64_t> sum, std::span<std::int64_t> sum_of_squares) {
  CHECK_EQ(sum.size(), size());
  CHECK_EQ(sum_of_squares.size(), size());
  if (empty_) {
    return;
  }
  for (std::size_t row = 0; row < 3 * coefficients_; ++row) {
    for (std::size_t column = 0; column < coefficients_; ++column) {
      const std::size_t from = row * stride_ + column;
      const std::size_t to = row * coefficients_ + column;
      sum[to] += core::to_fixed_point(
          std::clamp(static_cast<double>(sum_[from]), -kLargestChunkSum, kLargestChunkSum));
      sum_of_squares[to] += core::to_fixed_point(
          std::min(static_cast<double>(sum_of_squares_[from]), kLargestChunkSum));
    }
  }
  std::fill(sum_.begin(), sum_.end(), 0.0f);
  std::fill(sum_of_squares_.begin(), sum_of_squares_.end(), 0.0f);
  empty_ = true;
}

}  // namespace weft::transport
