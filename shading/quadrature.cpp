#include "shading/quadrature.h"

#include <cmath>
#include <numbers>

namespace weft::shading {

QuadratureRule gauss_legendre(int count) {
  QuadratureRule rule;
  rule.nodes.resize(static_cast<std::size_t>(count));
  rule.weights.resize(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k) {
    // Newton's method from Tricomi's estimate of the root of P_n.
    double x = -std::cos(std::numbers::pi * (k + 0.75) / (count + 0.5));
    double slope = 1;
    for (int step = 0; step < 100; ++step) {
      double before = 1;
      double value = x;
      for (int l = 2; l <= count; ++l) {
        const double next = ((2 * l - 1) * x * value - (l - 1) * before) / l;
        before = value;
        value = next;
      }
      slope = count * (x * value - before) / (x * x - 1);
      const double dx = value / slope;
      x -= dx;
      if (std::abs(dx) < 1e-16) {
        break;
      }
    }
    rule.nodes[static_cast<std::size_t>(k)] = x;
    rule.weights[static_cast<std::size_t>(k)] = 2 / ((1 - x * x) * slope * slope);
  }
  return rule;
}

}  // namespace weft::shading
