#include "shading/azimuth_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace weft::shading {
namespace {

constexpr float kPiFloat = std::numbers::pi_v<float>;

}  // namespace

AzimuthTable::AzimuthTable(double kappa)
    : density_(kCells + 1), cumulative_(kCells + 1), guide_(kCells + 1) {
  const double width = std::numbers::pi / kCells;
  std::vector<double> p(kCells + 1);
  std::vector<double> sum(kCells + 1);
  for (std::size_t k = 0; k <= kCells; ++k) {
    p[k] = std::exp(kappa * (std::cos(static_cast<double>(k) * width) - 1));
    sum[k] = k == 0 ? 0 : sum[k - 1] + 0.5 * width * (p[k - 1] + p[k]);
  }
  std::size_t knot = 0;
  for (std::size_t k = 0; k <= kCells; ++k) {
    density_[k] = static_cast<float>(p[k] / sum[kCells]);
    cumulative_[k] = static_cast<float>(sum[k] / sum[kCells]);
  }
  for (std::size_t j = 0; j <= kCells; ++j) {
    const float target = static_cast<float>(j) / kCells;
    while (knot + 1 < kCells && cumulative_[knot + 1] <= target) {
      ++knot;
    }
    guide_[j] = static_cast<std::uint16_t>(knot);
  }
}

AzimuthTable::Sample AzimuthTable::sample(float u) const {
  // The first half of u goes to the negative side.
  const float side = u < 0.5f ? -1.0f : 1.0f;
  const float w = std::min(u < 0.5f ? 1 - 2 * u : 2 * u - 1, 1.0f - 0x1p-24f);
  const auto j = static_cast<std::size_t>(w * kCells);
  const auto first = cumulative_.begin() + guide_[j];
  const auto last = cumulative_.begin() + guide_[j + 1] + 1;
  const auto k =
      static_cast<std::size_t>(std::upper_bound(first + 1, last, w) - cumulative_.begin() - 1);
  // Within the cell the density runs from p0 to p1: solve p0 x + (p1 - p0) x^2 / (2 width) = mass.
  const float width = kPiFloat / kCells;
  const float p0 = density_[k];
  const float p1 = density_[k + 1];
  const float mass = std::max(0.0f, w - cumulative_[k]);
  const float root = std::sqrt(std::max(0.0f, p0 * p0 + 2 * (p1 - p0) / width * mass));
  const float sum = p0 + root;
  const float x = sum > 0 ? std::min(2 * mass / sum, width) : 0.5f * width;
  Sample result;
  result.v = side * (static_cast<float>(k) * width + x);
  result.density = 0.5f * (p0 + (p1 - p0) * (x / width));
  return result;
}

float AzimuthTable::density(float v) const {
  const float t = std::min(std::abs(v) * (kCells / kPiFloat), static_cast<float>(kCells));
  const auto k = std::min(static_cast<std::size_t>(t), static_cast<std::size_t>(kCells - 1));
  const float f = t - static_cast<float>(k);
  return 0.5f * (density_[k] + (density_[k + 1] - density_[k]) * f);
}

}  // namespace weft::shading
