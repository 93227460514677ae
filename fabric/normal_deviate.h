#pragma once

#include <cmath>
#include <numbers>

#include "core/random.h"

namespace weft::fabric {

// A normally distributed number (Box and Muller 1958; the second of the pair is not used).
[[nodiscard]] inline double draw_normal(core::Random& random, double mean, double deviation) {
  const double u = 1 - random.uniform_double();
  const double v = random.uniform_double();
  return mean + deviation * std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

}  // namespace weft::fabric
