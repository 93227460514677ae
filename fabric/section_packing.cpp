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

struct Push {
  glm::dvec2 sum_mm{0};
  double count = 0;
};

// Pushes two points that are closer than `apart_mm` away from each other, each by half.
void part(glm::dvec2 a_mm, glm::dvec2 b_mm, double apart_mm, Push& on_a, Push& on_b) {
  const glm::dvec2 step = b_mm - a_mm;
  const double distance2 = glm::dot(step, step);
  if (distance2 >= apart_mm * apart_mm) {
    return;
  }
  const double distance = std::sqrt(distance2);
  const glm::dvec2 away = distance > 0 ? step / distance : glm::dvec2(1, 0);
  const glm::dvec2 push = away * (0.5 * (apart_mm - distance));
  on_a.sum_mm -= push;
  on_b.sum_mm += push;
  on_a.count += 1;
  on_b.count += 1;
}

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
  std::vector<Push> pushes(count);
  for (int n = 0; n < kIterations; ++n) {
    std::fill(pushes.begin(), pushes.end(), Push{});
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = i + 1; j < count; ++j) {
        part(points_mm[i], points_mm[j], apart, pushes[i], pushes[j]);
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      points_mm[i] += pushes[i].sum_mm * (kPush / std::max(1.0, pushes[i].count));
      const double out = glm::length(points_mm[i] / half_mm);
      if (out > 1) {
        points_mm[i] /= out;
      }
    }
  }
}

}  // namespace weft::fabric
