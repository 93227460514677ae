#include "transport/visibility_sg.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "core/random.h"
#include "shading/visibility.h"
#include "transport/sphere.h"
#include "transport/visibility.h"

namespace weft::transport {

std::uint16_t sg_rotation(std::uint64_t seed, std::uint32_t segment) {
  return static_cast<std::uint16_t>(core::Random(seed, segment).bits() >> 16);
}

std::vector<glm::vec3> sg_axes(std::uint32_t count, std::uint16_t rotation) {
  const float turn = static_cast<float>(rotation) * (shading::kTwoPi / 65536);
  std::vector<glm::vec3> axes;
  axes.reserve(count);
  for (std::uint32_t q = 0; q < count; ++q) {
    axes.push_back(shading::fibonacci_axis(static_cast<int>(q), static_cast<int>(count), turn));
  }
  return axes;
}

std::vector<float> sg_weights(std::span<const std::uint8_t> bits, std::uint32_t resolution,
                              std::span<const glm::vec3> axes) {
  CHECK_EQ(bits.size(), std::size_t{resolution} * resolution / 8);
  CHECK_GT(axes.size(), 0U);
  std::vector<float> cosine(resolution);
  std::vector<float> sine(resolution);
  for (std::uint32_t column = 0; column < resolution; ++column) {
    cosine[column] = static_cast<float>(std::cos(column_phi(column, resolution)));
    sine[column] = static_cast<float>(std::sin(column_phi(column, resolution)));
  }
  std::vector<double> weights(axes.size());
  std::vector<float> best(resolution);
  std::vector<std::uint32_t> nearest(resolution);
  for (std::uint32_t row = 0; row < resolution / 2; ++row) {
    // All columns of a row at once: the loops over columns run in vector registers.
    std::fill(best.begin(), best.end(), -2.0f);
    const double theta = row_theta(row, resolution);
    const auto sin_theta = static_cast<float>(std::sin(theta));
    const auto cos_theta = static_cast<float>(std::cos(theta));
    for (std::uint32_t q = 0; q < axes.size(); ++q) {
      const float x = axes[q].x * sin_theta;
      const float y = axes[q].y * sin_theta;
      const float z = axes[q].z * cos_theta;
      for (std::uint32_t column = 0; column < resolution; ++column) {
        const float dot = x * cosine[column] + y * sine[column] + z;
        nearest[column] = dot > best[column] ? q : nearest[column];
        best[column] = std::max(best[column], dot);
      }
    }
    const double solid_angle = pixel_solid_angle(row, resolution);
    for (std::uint32_t column = 0; column < resolution; ++column) {
      if (is_visible(bits, std::size_t{row} * resolution + column)) {
        weights[nearest[column]] += solid_angle;
      }
    }
  }
  return {weights.begin(), weights.end()};
}

double open_share(std::span<const std::uint8_t> bits, std::uint32_t resolution) {
  CHECK_EQ(bits.size(), std::size_t{resolution} * resolution / 8);
  double sum = 0;
  for (std::uint32_t row = 0; row < resolution; ++row) {
    std::uint32_t visible = 0;
    for (std::uint32_t column = 0; column < resolution; ++column) {
      visible += is_visible(bits, std::size_t{row} * resolution + column) ? 1 : 0;
    }
    sum += visible * pixel_solid_angle(row, resolution);
  }
  return sum / (4 * std::numbers::pi);
}

}  // namespace weft::transport
