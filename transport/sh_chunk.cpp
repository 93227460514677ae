#include "transport/sh_chunk.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "core/check.h"
#include "core/moments.h"
#include "shading/spherical_harmonics.h"

namespace weft::transport {

namespace {

constexpr std::size_t kLanes = 8;

// Coefficients of a direction, zero as far as the stride goes.
using Harmonics = std::array<float, shading::kShMaxCount + kLanes>;

Harmonics harmonics(glm::vec3 direction, std::size_t count) {
  const shading::ShVector all = shading::sh_evaluate(direction);
  Harmonics used{};
  std::copy_n(std::begin(all.c), count, used.begin());
  return used;
}

}  // namespace

ShChunk::ShChunk(std::uint32_t order)
    : coefficients_(std::size_t{order + 1} * (order + 1)),
      stride_((coefficients_ + kLanes - 1) / kLanes * kLanes),
      sum_(3 * coefficients_ * stride_),
      sum_of_squares_(3 * coefficients_ * stride_) {
  CHECK_LE(order, static_cast<std::uint32_t>(shading::kShMaxOrder));
}

void ShChunk::add(glm::vec3 weight, glm::vec3 row_direction, glm::vec3 column_direction) {
  if (weight == glm::vec3(0, 0, 0)) {
    return;
  }
  empty_ = false;
  const Harmonics rows = harmonics(row_direction, coefficients_);
  const Harmonics columns = harmonics(column_direction, coefficients_);
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
          std::clamp(static_cast<double>(sum_[from]), -kLargestSum, kLargestSum));
      sum_of_squares[to] +=
          core::to_fixed_point(std::min(static_cast<double>(sum_of_squares_[from]), kLargestSum));
    }
  }
  std::fill(sum_.begin(), sum_.end(), 0.0f);
  std::fill(sum_of_squares_.begin(), sum_of_squares_.end(), 0.0f);
  empty_ = true;
}

}  // namespace weft::transport
