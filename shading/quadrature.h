#pragma once

#include <vector>

namespace weft::shading {

// Gauss-Legendre rule on [-1, 1].
struct QuadratureRule {
  std::vector<double> nodes;
  std::vector<double> weights;
};

// The rule with `count` nodes, to full double precision. REQUIRES: count > 0.
[[nodiscard]] QuadratureRule gauss_legendre(int count);

// Integral of `f` over [low, high] by `rule`.
template <class F>
[[nodiscard]] double integrate(const QuadratureRule& rule, double low, double high, const F& f) {
  const double middle = 0.5 * (low + high);
  const double half = 0.5 * (high - low);
  double sum = 0;
  for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
    sum += rule.weights[k] * f(middle + half * rule.nodes[k]);
  }
  return sum * half;
}

}  // namespace weft::shading
