#include "fabric/section_packing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

namespace weft::fabric {

namespace {

constexpr int kIterations = 60;
constexpr double kPush = 1.2;     // of the mean correction of a point's neighbours
constexpr double kLoosest = 0.8;  // of the distance in the densest packing: what random ones reach

}  // namespace

void spread_in_ellipse(std::vector<glm::dvec2>& points_mm, glm::dvec2 half_mm, double apart_mm) {
  const std::size_t count = points_mm.size();
  if (count < 2 || !(half_mm.x > 0) || !(half_mm.y > 0)) {
    return;
  }
  // Points d apart in a hexagonal lattice take sqrt(3)/2 d^2 each.
  const double area =
      std::numbers::pi * (half_mm.x + 0.5 * apart_mm) * (half_mm.y + 0.5 * apart_mm);
  const double densest = std::sqrt(area / static_cast<double>(count) * 2 / std::numbers::sqrt3);
  const double apart = std::min(apart_mm, kLoosest * densest);
  std::vector<glm::dvec2> corrections(count);
  std::vector<double> weights(count);
  for (int n = 0; n < kIterations; ++n) {
    std::fill(corrections.begin(), corrections.end(), glm::dvec2(0));
    std::fill(weights.begin(), weights.end(), 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = i + 1; j < count; ++j) {
        const glm::dvec2 step = points_mm[j] - points_mm[i];
        const double distance2 = glm::dot(step, step);
        if (distance2 >= apart * apart) {
          continue;
        }
        const double distance = std::sqrt(distance2);
        const glm::dvec2 away = distance > 0 ? step / distance : glm::dvec2(1, 0);
        corrections[i] -= away * (0.5 * (apart - distance));
        corrections[j] += away * (0.5 * (apart - distance));
        weights[i] += 1;
        weights[j] += 1;
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      points_mm[i] += corrections[i] * (kPush / std::max(1.0, weights[i]));
      const double out = glm::length(points_mm[i] / half_mm);
      if (out > 1) {
        points_mm[i] /= out;
      }
    }
  }
}

}  // namespace weft::fabric
