#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "shading/shadow_fit.h"

namespace weft::shading {
namespace {

// Light in bins of width 1, and beyond, for a share nearer(d) of light that came from nearer than
// d.
template <class Nearer>
std::vector<double> binned(int bins, double total, const Nearer& nearer) {
  std::vector<double> light;
  for (int i = 0; i < bins; ++i) {
    light.push_back(total * (nearer(i + 1.0) - nearer(i)));
  }
  light.push_back(total * (1 - nearer(bins)));
  return light;
}

TEST(ShadowFit, ANormalSpreadIsRecovered) {
  for (const double sigma : {0.5, 3.0, 24.0, 60.0}) {
    const auto light =
        binned(256, 7.5, [&](double d) { return std::erf(d / (sigma * std::sqrt(2.0))); });
    const ShadowFit fit = fit_shadow(light);
    EXPECT_NEAR(fit.sigma, sigma, 1e-4 * sigma);
    EXPECT_LT(fit.error, 1e-6);
  }
}

TEST(ShadowFit, AnExponentialSpreadIsFittedAsNoOtherSigmaDoes) {
  // Distances of density exp(-d / a) / a: the shadow is 1 - exp(-d / a) / 2 within the light.
  const double a = 20;
  const auto light = binned(256, 1, [&](double d) { return 1 - std::exp(-d / a); });
  const ShadowFit fit = fit_shadow(light);
  const auto misfit = [&](double sigma) {
    double sum = 0;
    for (int i = 1; i <= 256; ++i) {
      const double expected = 0.5 * (1 + std::erf(i / (sigma * std::sqrt(2.0))));
      const double difference = 1 - 0.5 * std::exp(-i / a) - expected;
      sum += difference * difference;
    }
    return sum;
  };
  for (const double other : {0.9, 0.98, 1.02, 1.1}) {
    EXPECT_LT(misfit(fit.sigma), misfit(other * fit.sigma));
  }
  EXPECT_GT(fit.error, 0.005);
  EXPECT_LT(fit.error, 0.05);
}

TEST(ShadowFit, LightFromBeyondTheBinsWidensTheShadow) {
  std::vector<double> light(65, 0.0);
  light[3] = 1;
  const double near_only = fit_shadow(light).sigma;
  light.back() = 0.5;
  EXPECT_GT(fit_shadow(light).sigma, near_only);
}

}  // namespace
}  // namespace weft::shading
