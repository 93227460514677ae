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

// Eight widths away from the axis nothing of the Gaussian is cut off,
double first_cut_off(double beta) { return std::max(0.0, kHalfPiExact - 8 * beta); }

// and over the whole line the integral is this.
double whole(double mu, double beta) {
  return 0.5 * (1 + std::exp(-2 * beta * beta) * std::cos(2 * mu));
}

}  // namespace

double lobe_normalisation(double mu, double beta) {
  if (std::abs(mu) < first_cut_off(beta)) {
    return whole(mu, beta);
  }
  const double low = std::max(-kHalfPiExact, mu - 12 * beta);
  const double high = std::min(kHalfPiExact, mu + 12 * beta);
  return integrate(rule_48(), low, high, [&](double t) {
    const double c = std::cos(t);
    return gaussian(t - mu, beta) * c * c;
  });
}

LobeNormalisation::LobeNormalisation(double beta)
    : beta_(beta),
      cut_off_(first_cut_off(beta)),
      piece_width_((kHalfPiExact - cut_off_) / kPieces) {
  // By its values at the Chebyshev nodes of each piece.
  constexpr auto kCount = static_cast<double>(kTerms);
  const auto node = [](std::size_t k) {
    return std::cos(std::numbers::pi * (static_cast<double>(k) + 0.5) / kCount);
  };
  for (std::size_t p = 0; p < kPieces; ++p) {
    const double middle = cut_off_ + (static_cast<double>(p) + 0.5) * piece_width_;
    for (std::size_t k = 0; k < kTerms; ++k) {
      const double value = lobe_normalisation(middle + 0.5 * piece_width_ * node(k), beta);
      for (std::size_t j = 0; j < kTerms; ++j) {
        const double angle =
            std::numbers::pi * static_cast<double>(j) * (static_cast<double>(k) + 0.5) / kCount;
        pieces_[p][j] += (j == 0 ? 1 : 2) / kCount * value * std::cos(angle);
      }
    }
  }
}

double LobeNormalisation::operator()(double mu) const {
  if (std::abs(mu) < cut_off_) {
    return whole(mu, beta_);
  }
  const double at = (std::abs(mu) - cut_off_) / piece_width_;
  const auto piece = std::min(static_cast<std::size_t>(at), kPieces - 1);
  const double x = 2 * (at - static_cast<double>(piece)) - 1;
  // Clenshaw's recurrence.
  double last = 0;
  double before = 0;
  for (std::size_t j = kTerms - 1; j > 0; --j) {
    const double next = 2 * x * last - before + pieces_[piece][j];
    before = last;
    last = next;
  }
  return x * last - before + pieces_[piece][0];
}

AdjointMoments adjoint_moments(double theta_o, const LobeNormalisation& norm) {
  const double beta = norm.beta();
  const double low = std::max(-kHalfPiExact, -theta_o - 9 * beta);
  const double high = std::min(kHalfPiExact, -theta_o + 9 * beta);
  const QuadratureRule& rule = rule_48();
  AdjointMoments sum;
  for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
    const double t = 0.5 * (low + high) + 0.5 * (high - low) * rule.nodes[k];
    const double c = std::cos(t);
    const double m = rule.weights[k] * c * c * gaussian(t + theta_o, beta) / norm(t);
    sum.plain += m;
    sum.schlick += m * std::pow(1 - c, 5);
  }
  sum.plain *= 0.5 * (high - low);
  sum.schlick *= 0.5 * (high - low);
  return sum;
}

}  // namespace weft::shading
