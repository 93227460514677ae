#include "render/sheen_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::render {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kSteps = 64;

struct Fit {
  Sheen sheen;
  double error = 0;
};

Fit fit_of(std::span<const SkyAlbedo> seen, double roughness) {
  const glm::dvec3 above = seen[0].albedo;
  std::vector<double> lobe;
  glm::dvec3 both(0);
  double squares = 0;
  for (const SkyAlbedo& at : seen.subspan(1)) {
    lobe.push_back(sheen_albedo(std::cos(at.theta), roughness));
    both += lobe.back() * (at.albedo - above);
    squares += lobe.back() * lobe.back();
  }
  const glm::dvec3 slope = both / std::max(squares, 1e-12);  // c - A(0) m
  double m = 0;
  for (int c = 0; c < 3; ++c) {
    m = std::max(m, slope[c] / std::max(1 - above[c], 1e-3));
  }
  Fit fit;
  fit.sheen.roughness = roughness;
  fit.sheen.colour = glm::clamp(slope + m * above, glm::dvec3(0), glm::dvec3(1));
  m = std::max({fit.sheen.colour.x, fit.sheen.colour.y, fit.sheen.colour.z});
  for (std::size_t i = 1; i < seen.size(); ++i) {
    const glm::dvec3 model = fit.sheen.colour * lobe[i - 1] + above * (1 - m * lobe[i - 1]);
    const glm::dvec3 off = model - seen[i].albedo;
    fit.error += glm::dot(off, off);
  }
  return fit;
}

}  // namespace

double sheen_albedo(double cos_theta, double roughness) {
  const double power = 1 / (roughness * roughness);
  const double sin_theta = std::sqrt(std::max(0.0, 1 - cos_theta * cos_theta));
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double z = (i + 0.5) / kSteps;  // N.L; equal steps are equal solid angles
    const double r = std::sqrt(1 - z * z);
    for (int j = 0; j < kSteps; ++j) {
      const double phi = kPi * (j + 0.5) / kSteps;  // the other half is alike
      const glm::dvec3 half = glm::normalize(
          glm::dvec3(r * std::cos(phi) + sin_theta, r * std::sin(phi), z + cos_theta));
      const double sine = std::sqrt(std::max(0.0, 1 - half.z * half.z));
      const double d = (2 + power) * std::pow(sine, power) / (2 * kPi);
      sum += d * z / (4 * (z + cos_theta - z * cos_theta));
    }
  }
  return sum * 2 * kPi / (kSteps * kSteps);
}

Sheen fit_sheen(std::span<const SkyAlbedo> seen) {
  CHECK(seen.size() >= 2);
  Fit best;
  best.error = std::numeric_limits<double>::infinity();
  for (int step = 2; step <= 20; ++step) {
    const Fit fit = fit_of(seen, step / 20.0);
    if (fit.error < best.error) {
      best = fit;
    }
  }
  return best.sheen;
}

}  // namespace weft::render
