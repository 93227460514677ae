#include "shading/lobe_normalisation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "shading/quadrature.h"

namespace weft::shading {
namespace {

constexpr double kHalfPiExact = std::numbers::pi / 2;

double gaussian(double t, double beta) {
  const double x = t / beta;
  return std::exp(-0.5 * x * x) / (std::sqrt(2 * std::numbers::pi) * beta);
}

const QuadratureRule& rule_48() {
  static const QuadratureRule rule = gauss_legendre(48);
  return rule;
}

}  // namespace

double lobe_normalisation(double mu, double beta) {
  // Eight widths away from the axis nothing of the Gaussian is cut off, and over the whole line
  // the integral is (1 + exp(-2 beta^2) cos 2 mu) / 2.
  if (std::abs(mu) < kHalfPiExact - 8 * beta) {
    return 0.5 * (1 + std::exp(-2 * beta * beta) * std::cos(2 * mu));
  }
  const double low = std::max(-kHalfPiExact, mu - 12 * beta);
  const double high = std::min(kHalfPiExact, mu + 12 * beta);
  return integrate(rule_48(), low, high, [&](double t) {
    const double c = std::cos(t);
    return gaussian(t - mu, beta) * c * c;
  });
}

AdjointMoments adjoint_moments(double theta_o, double beta) {
  const double low = std::max(-kHalfPiExact, -theta_o - 9 * beta);
  const double high = std::min(kHalfPiExact, -theta_o + 9 * beta);
  const QuadratureRule& rule = rule_48();
  AdjointMoments sum;
  for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
    const double t = 0.5 * (low + high) + 0.5 * (high - low) * rule.nodes[k];
    const double c = std::cos(t);
    const double m =
        rule.weights[k] * c * c * gaussian(t + theta_o, beta) / lobe_normalisation(t, beta);
    sum.plain += m;
    sum.schlick += m * std::pow(1 - c, 5);
  }
  sum.plain *= 0.5 * (high - low);
  sum.schlick *= 0.5 * (high - low);
  return sum;
}

}  // namespace weft::shading
