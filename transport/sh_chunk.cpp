#include "transport/sh_chunk.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <immintrin.h>

#include "core/check.h"
#include "core/moments.h"
#include "shading/spherical_harmonics.h"

namespace weft::transport {

namespace {

// A tile of the product, whose sums fill 12 of the 16 vector registers.
constexpr std::size_t kTileRows = 6;
constexpr std::size_t kTileColumns = 16;

constexpr std::size_t whole_tiles(std::size_t count, std::size_t tile) {
  return (count + tile - 1) / tile * tile;
}

// sum[row, column] += a[path, row] b[path, column] over the paths, for one tile: products are fused
// and added in the order of the paths, and the tile's sum is added last.
struct TileProduct {
  const float* a;
  std::size_t a_stride;
  const float* b;
  std::size_t b_stride;
  std::size_t paths;
};
void add_tile(const TileProduct& of, float* sum, std::size_t sum_stride) {
  __m256 low[kTileRows];
  __m256 high[kTileRows];
  for (std::size_t row = 0; row < kTileRows; ++row) {
    low[row] = _mm256_setzero_ps();
    high[row] = _mm256_setzero_ps();
  }
  for (std::size_t path = 0; path < of.paths; ++path) {
    const float* a = of.a + path * of.a_stride;
    const __m256 b_low = _mm256_loadu_ps(of.b + path * of.b_stride);
    const __m256 b_high = _mm256_loadu_ps(of.b + path * of.b_stride + 8);
    for (std::size_t row = 0; row < kTileRows; ++row) {
      const __m256 factor = _mm256_broadcast_ss(a + row);
      low[row] = _mm256_fmadd_ps(factor, b_low, low[row]);
      high[row] = _mm256_fmadd_ps(factor, b_high, high[row]);
    }
  }
  for (std::size_t row = 0; row < kTileRows; ++row) {
    float* to = sum + row * sum_stride;
    _mm256_storeu_ps(to, _mm256_add_ps(_mm256_loadu_ps(to), low[row]));
    _mm256_storeu_ps(to + 8, _mm256_add_ps(_mm256_loadu_ps(to + 8), high[row]));
  }
}

}  // namespace

ShChunk::ShChunk(std::uint32_t order)
    : coefficients_(std::size_t{order + 1} * (order + 1)),
      rows_(whole_tiles(coefficients_, kTileRows)),
      columns_(whole_tiles(3 * coefficients_, kTileColumns)),
      arrivals_(kBlockPaths * rows_),
      lights_(kBlockPaths * columns_),
      sum_(rows_ * columns_),
      sum_of_squares_(rows_ * columns_) {
  CHECK_LE(order, static_cast<std::uint32_t>(shading::kShMaxOrder));
}

void ShChunk::add(glm::vec3 arrival, std::span<const LightSample> lights) {
  if (lights.empty()) {
    return;
  }
  float* columns = &lights_[paths_ * columns_];
  std::fill_n(columns, columns_, 0.0f);
  for (const LightSample& light : lights) {
    const shading::ShVector y = shading::sh_evaluate(light.direction);
    for (std::size_t c = 0; c < 3; ++c) {
      const float weight = light.weight[static_cast<int>(c)];
      for (std::size_t j = 0; j < coefficients_; ++j) {
        columns[c * coefficients_ + j] = std::fma(weight, y.c[j], columns[c * coefficients_ + j]);
      }
    }
  }
  const shading::ShVector y = shading::sh_evaluate(arrival);
  std::copy_n(std::begin(y.c), coefficients_, &arrivals_[paths_ * rows_]);
  empty_ = false;
  if (++paths_ == kBlockPaths) {
    project_block();
  }
}

void ShChunk::project_block() {
  const auto multiply = [this](std::vector<float>& sum) {
    for (std::size_t row = 0; row < rows_; row += kTileRows) {
      for (std::size_t column = 0; column < columns_; column += kTileColumns) {
        add_tile({&arrivals_[row], rows_, &lights_[column], columns_, paths_},
                 &sum[row * columns_ + column], columns_);
      }
    }
  };
  multiply(sum_);
  // The square of a product is the product of the squares.
  const auto square = [](std::vector<float>& values, std::size_t count) {
    std::transform(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count),
                   values.begin(), [](float value) { return value * value; });
  };
  square(arrivals_, paths_ * rows_);
  square(lights_, paths_ * columns_);
  multiply(sum_of_squares_);
  paths_ = 0;
}

void ShChunk::flush(std::span<std::int64_t> sum, std::span<std::int64_t> sum_of_squares) {
  CHECK_EQ(sum.size(), size());
  CHECK_EQ(sum_of_squares.size(), size());
  if (empty_) {
    return;
  }
  project_block();
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t row = 0; row < coefficients_; ++row) {
      for (std::size_t column = 0; column < coefficients_; ++column) {
        const std::size_t from = row * columns_ + c * coefficients_ + column;
        const std::size_t to = (c * coefficients_ + row) * coefficients_ + column;
        sum[to] += core::to_fixed_point(
            std::clamp(static_cast<double>(sum_[from]), -kLargestSum, kLargestSum));
        sum_of_squares[to] +=
            core::to_fixed_point(std::min(static_cast<double>(sum_of_squares_[from]), kLargestSum));
      }
    }
  }
  std::fill(sum_.begin(), sum_.end(), 0.0f);
  std::fill(sum_of_squares_.begin(), sum_of_squares_.end(), 0.0f);
  empty_ = true;
}

}  // namespace weft::transport
