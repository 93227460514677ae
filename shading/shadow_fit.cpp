#include "shading/shadow_fit.h"

#include <cmath>
#include <cstddef>
#include <vector>

namespace weft::shading {
namespace {

constexpr double kLeastSigma = 0.05;  // of a bin
constexpr double kGolden = 0.6180339887498949;

// Sum of squared differences at the bins' borders nearer than `reach`, and how many there are.
struct Misfit {
  double squared = 0;
  std::size_t borders = 0;
};
Misfit misfit(const std::vector<double>& nearer, double sigma, double reach) {
  Misfit result;
  for (std::size_t i = 0; i < nearer.size() && static_cast<double>(i + 1) <= reach; ++i) {
    const double expected = std::erf(static_cast<double>(i + 1) / (sigma * std::sqrt(2.0)));
    const double difference = 0.5 * (nearer[i] - expected);
    result.squared += difference * difference;
    ++result.borders;
  }
  return result;
}

}  // namespace

ShadowFit fit_shadow(std::span<const double> light) {
  double total = 0;
  for (const double part : light) {
    total += part;
  }
  std::vector<double> nearer;  // F at the upper border of each bin
  double so_far = 0;
  for (std::size_t i = 0; i + 1 < light.size(); ++i) {
    so_far += light[i];
    nearer.push_back(so_far / total);
  }
  const auto bins = static_cast<double>(nearer.size());
  // Golden section over log sigma: the misfit has one minimum, for erf grows everywhere as sigma
  // falls.
  double low = std::log(kLeastSigma);
  double high = std::log(bins);
  for (int i = 0; i < 80; ++i) {
    const double a = high - kGolden * (high - low);
    const double b = low + kGolden * (high - low);
    const bool is_left =
        misfit(nearer, std::exp(a), bins).squared < misfit(nearer, std::exp(b), bins).squared;
    (is_left ? high : low) = is_left ? b : a;
  }
  ShadowFit fit;
  fit.sigma = std::exp(0.5 * (low + high));
  const Misfit seen = misfit(nearer, fit.sigma, std::fmax(1, 4 * fit.sigma));
  fit.error = std::sqrt(seen.squared / static_cast<double>(seen.borders));
  return fit;
}

}  // namespace weft::shading
