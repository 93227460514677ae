#include "render/surface_lobe.h"

#include <algorithm>
#include <cmath>

namespace weft::render {
namespace {

constexpr double kLeastWidth = 0.01;
constexpr double kPi = 3.14159265358979323846;

}  // namespace

double ggx_squared_sine(double alpha) {
  const double a = alpha * alpha;
  const double k = 1 - a;
  if (std::fabs(k) < 1e-3) {
    return 0.5 - k / 6;  // the first terms of its series
  }
  return a / (k * k) * (a - 1 - std::log(a));
}

double ggx_width(double variance) {
  double low = kLeastWidth;
  double high = 1;
  if (!(variance > 0.5 * ggx_squared_sine(low))) {
    return low;
  }
  if (variance >= 0.5 * ggx_squared_sine(high)) {
    return high;
  }
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * ggx_squared_sine(middle) < variance ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

SurfaceLobe surface_lobe(double xx, double xy, double yy) {
  const double mean = 0.5 * (xx + yy);
  const double half = 0.5 * (xx - yy);
  const double spread = std::hypot(half, xy);
  const double along = ggx_width(mean - spread);
  const double across = ggx_width(mean + spread);
  SurfaceLobe lobe;
  lobe.roughness = static_cast<float>(std::sqrt(along));
  if (along < 1) {
    lobe.anisotropy = static_cast<float>(std::sqrt((across - along) / (1 - along)));
  }
  if (spread > 0) {
    double angle = 0.5 * std::atan2(xy, half);  // of the greater axis
    if (angle < -0.25 * kPi) {
      angle += kPi;
    }
    lobe.across = {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
  }
  return lobe;
}

}  // namespace weft::render
