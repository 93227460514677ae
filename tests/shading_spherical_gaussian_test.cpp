#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "shading/bessel.h"
#include "shading/error_function.h"
#include "shading/normal_quantile.h"
#include "shading/quadrature.h"
#include "shading/spherical_gaussian.h"
#include "tests/shading_vectors.h"

namespace weft::shading {
namespace {

vec3 to_vec3(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

TEST(BesselI0e, MatchesTheReferenceToFiveInTenMillion) {
  for (const auto& v : vectors::kBesselI0e) {
    EXPECT_NEAR(bessel_i0e(static_cast<float>(v.x)), v.value, 7e-7 * v.value) << v.x;
  }
  for (double x = 0; x < 20; x += 0.037) {
    const double exact = std::cyl_bessel_i(0.0, x) * std::exp(-x);
    EXPECT_NEAR(bessel_i0e(static_cast<float>(x)), exact, 1e-6 * exact) << x;
  }
}

TEST(ErrorFunction, MatchesTheLibrary) {
  for (int k = -6000; k <= 6000; ++k) {
    const float x = static_cast<float>(k) * 1e-3f;
    EXPECT_NEAR(error_function(x), std::erf(static_cast<double>(x)), 2e-7) << x;
  }
  EXPECT_FLOAT_EQ(error_function(1e30f), 1);
  EXPECT_FLOAT_EQ(error_function(-1e30f), -1);
}

TEST(NormalQuantile, InvertsTheUpperTail) {
  for (double x = 0; x < 5.5; x += 0.01) {
    const double q = 0.5 * std::erfc(x / std::numbers::sqrt2);
    // q itself is rounded to float, which moves x by 1e-7 q / density.
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
    EXPECT_NEAR(normal_upper_quantile(static_cast<float>(q)), x, 1e-6 + 2e-7 * q / density) << x;
  }
}

TEST(SphericalGaussian, MassMatchesTheReference) {
  for (const auto& v : vectors::kSgMass) {
    EXPECT_NEAR(sg_mass(static_cast<float>(v.lambda)), v.value, 5e-7 * v.value) << v.lambda;
  }
  for (double lambda = 0.001; lambda < 2; lambda *= 1.1) {
    const double exact = -2 * std::numbers::pi * std::expm1(-2 * lambda) / lambda;
    EXPECT_NEAR(sg_mass(static_cast<float>(lambda)), exact, 5e-7 * exact) << lambda;
  }
}

TEST(SphericalGaussian, MassIsItsIntegral) {
  const QuadratureRule rule = gauss_legendre(64);
  const SphericalGaussian g{{0, 0, 1}, 12};
  const double integral = integrate(rule, -1, 1, [&](double z) {
    const double s = std::sqrt(1 - z * z);
    return 2 * std::numbers::pi * sg_evaluate(g, {static_cast<float>(s), 0, static_cast<float>(z)});
  });
  EXPECT_NEAR(integral, sg_mass(12), 1e-5 * integral);
}

TEST(SphericalGaussian, ProductMatchesTheReference) {
  for (const auto& v : vectors::kSgProduct) {
    const SgProduct p = sg_product({to_vec3(v.xi1), static_cast<float>(v.lambda1)},
                                   {to_vec3(v.xi2), static_cast<float>(v.lambda2)});
    EXPECT_NEAR(p.sg.sharpness, v.lambda_sum, 1e-6 * v.lambda_sum);
    EXPECT_NEAR(p.log_scale, v.log_scale, 1e-6 * std::abs(v.log_scale));
    EXPECT_NEAR(length(p.sg.axis - to_vec3(v.xi_sum)), 0, 1e-6);
  }
}

TEST(SphericalGaussian, OppositeEqualGaussiansGiveAConstant) {
  const SgProduct p = sg_product({{0, 0, 1}, 30}, {{0, 0, -1}, 30});
  EXPECT_EQ(p.sg.sharpness, 0);
  EXPECT_FLOAT_EQ(p.log_scale, -60);
  EXPECT_FLOAT_EQ(length(p.sg.axis), 1);
  const SgProduct none = sg_product({{0, 0, 1}, 0}, {{1, 0, 0}, 0});
  EXPECT_EQ(none.log_scale, 0);
}

}  // namespace
}  // namespace weft::shading
