#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace weft::shading {

// log Gamma(a) for whole and half numbers a, by Gamma(a + 1) = a Gamma(a).
inline double log_gamma_of_half(double a) {
  const bool whole = a == std::floor(a);
  double sum = whole ? 0 : 0.5 * std::log(std::numbers::pi);
  const double first = whole ? 1 : 0.5;
  for (int k = 0; first + k < a; ++k) {
    sum += std::log(first + k);
  }
  return sum;
}

// Upper regularised incomplete gamma function Q(a, x) for whole and half numbers a, by series or
// continued fraction.
inline double upper_gamma_share(double a, double x) {
  const double scale = std::exp(-x + a * std::log(x) - log_gamma_of_half(a));
  if (x < a + 1) {
    double term = 1 / a;
    double sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-16; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1 - sum * scale;
  }
  double b = x + 1 - a;
  double c = 1e300;
  double d = 1 / b;
  double h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    h *= d * c;
    if (std::abs(d * c - 1) < 1e-15) {
      break;
    }
  }
  return scale * h;
}

// Probability of a chi-square statistic at least as large as that of the counts, cells of fewer
// than five expected samples pooled.
inline double chi_square_p_value(const std::vector<double>& observed,
                                 const std::vector<double>& expected) {
  double statistic = 0;
  double pooled_observed = 0;
  double pooled_expected = 0;
  int cells = 0;
  const auto add = [&](double o, double e) {
    statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (std::size_t k = 0; k < observed.size(); ++k) {
    if (expected[k] < 5) {
      pooled_observed += observed[k];
      pooled_expected += expected[k];
    } else {
      add(observed[k], expected[k]);
    }
  }
  if (pooled_expected > 5) {
    add(pooled_observed, pooled_expected);
  } else if (pooled_observed > 25) {
    return 0;  // many samples where hardly any may fall
  }
  return cells < 2 ? 1 : upper_gamma_share(0.5 * (cells - 1), 0.5 * statistic);
}

// The significance of each of `count` tests that together reject with probability 0.01 (Sidak).
inline double sidak_level(int count) { return 1 - std::pow(1 - 0.01, 1.0 / count); }

}  // namespace weft::shading
