#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/random.h"
#include "shading/fibre_bcsdf.h"
#include "shading/gamma.h"
#include "shading/visibility.h"
#include "tests/shading_fibres.h"
#include "tests/shading_vectors.h"

namespace weft::shading {
namespace {

vec3 random_direction(core::Random& random) {
  const float z = 2 * random.uniform() - 1;
  const float phi = kTwoPi * random.uniform();
  const float s = std::sqrt(1 - z * z);
  return {s * std::cos(phi), s * std::sin(phi), z};
}

TEST(VisibilityMap, PixelsAndTheirCentresAgree) {
  for (const int resolution : {8, 128}) {
    for (int row = 0; row < resolution; ++row) {
      for (int column = 0; column < resolution; ++column) {
        const vec3 w = map_direction(row, column, resolution);
        ASSERT_EQ(map_pixel(w, resolution), row * resolution + column);
      }
    }
  }
}

TEST(VisibilityMap, RowsRunFromUpToDownAndColumnsFromXToY) {
  EXPECT_EQ(map_pixel({0, 0, 1}, 128) / 128, 0);
  EXPECT_EQ(map_pixel({0, 0, -1}, 128) / 128, 127);
  EXPECT_EQ(map_pixel(normalize(vec3(1, 1e-3f, 1e-3f)), 128), 63 * 128);
  EXPECT_EQ(map_pixel(normalize(vec3(1e-3f, 1, 1e-3f)), 128), 63 * 128 + 31);
  EXPECT_EQ(map_pixel(normalize(vec3(1, -1e-3f, 1e-3f)), 128), 63 * 128 + 127);
}

TEST(VisibilityMap, SolidAnglesSumToTheSphere) {
  double sum = 0;
  for (int row = 0; row < 128; ++row) {
    const double top = std::cos(std::numbers::pi * row / 128);
    const double bottom = std::cos(std::numbers::pi * (row + 1) / 128);
    const double exact = 2 * std::numbers::pi / 128 * (top - bottom);
    EXPECT_NEAR(map_solid_angle(row, 128), exact, 1e-6 * exact);
    sum += 128.0 * map_solid_angle(row, 128);
  }
  EXPECT_NEAR(sum, 4 * std::numbers::pi, 1e-5);
}

TEST(VisibilityMap, LookupInterpolatesAcrossTheSeamAndThePoles) {
  // A smooth function of the direction comes back to the order of the squared pixel.
  const auto f = [](vec3 w) { return w.x + 0.5f * w.y - 0.3f * w.z + w.x * w.y; };
  core::Random random(3, 1);
  for (int n = 0; n < 5000; ++n) {
    vec3 w = random_direction(random);
    if (n % 3 == 0) {
      w = normalize(vec3(0.01f * w.x, 0.01f * w.y, w.z));
    } else if (n % 3 == 1) {
      w = normalize(vec3(std::abs(w.x), 0.01f * w.y, w.z));
    }
    const MapFootprint p = map_footprint(w, 128);
    float sum = 0;
    float weights = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      ASSERT_GE(p.index[k], 0);
      ASSERT_LT(p.index[k], 128 * 128);
      ASSERT_GE(p.weight[k], -1e-6f);
      sum += p.weight[k] * f(map_direction(p.index[k] / 128, p.index[k] % 128, 128));
      weights += p.weight[k];
    }
    ASSERT_NEAR(weights, 1, 1e-5);
    ASSERT_NEAR(sum, f(w), 3e-3);
  }
}

TEST(Visibility, FibonacciAxesMatchTheReference) {
  for (const auto& v : vectors::kFibonacciAxes) {
    const int q = static_cast<int>(v.q) - 1;
    const vec3 axis = v.sphere > 0 ? fibonacci_axis_sphere(q, 48, 0) : fibonacci_axis(q, 48, 0);
    EXPECT_NEAR(axis.x, v.axis[0], 1e-5);
    EXPECT_NEAR(axis.y, v.axis[1], 1e-5);
    EXPECT_NEAR(axis.z, v.axis[2], 1e-6);
  }
  const vec3 turned = fibonacci_axis(5, 48, 0.7f);
  const vec3 plain = fibonacci_axis(5, 48, 0);
  EXPECT_NEAR(turned.x, plain.x * std::cos(0.7f) - plain.y * std::sin(0.7f), 1e-6);
}

TEST(Visibility, SignedDistanceMatchesTheReferenceAndAStraightEdge) {
  for (const auto& v : vectors::kSsdfEdge) {
    const float value =
        ssdf_visibility(static_cast<float>(v.distance), static_cast<float>(v.lambda));
    EXPECT_NEAR(value, v.erf, 1e-6);
    EXPECT_NEAR(value, v.exact, 0.11 / v.lambda);
  }
}

TEST(Visibility, BlendMatchesTheReference) {
  for (const auto& v : vectors::kBlend) {
    EXPECT_NEAR(ssdf_share(static_cast<float>(v.lambda), 100, 200), v.ssdf_share, 1e-6);
  }
  EXPECT_EQ(ssdf_share(99, 100, 100), 0);
  EXPECT_EQ(ssdf_share(101, 100, 100), 1);
}

TEST(Visibility, SumOfGaussiansMatchesTheReferenceWithGamma) {
  for (const auto& v : vectors::kSsgSingle) {
    const FibreBcsdf& bcsdf = published(v.fibre);
    const vec3 xi(static_cast<float>(v.xi[0]), static_cast<float>(v.xi[1]),
                  static_cast<float>(v.xi[2]));
    const vec3 omega_o = fibre_direction(v.theta_o, 0);
    const float lambda = static_cast<float>(v.lambda);
    double sum = 0;
    for (int q = 0; q < 48; ++q) {
      const vec3 axis = fibonacci_axis(q, 48, 0);
      if (axis.x > -0.2f) {
        const SgProduct p = sg_product({xi, lambda}, {axis, 128});
        sum += kTwoPi / 48 / sg_mass(128) * std::exp(p.log_scale) *
               gamma_integral(bcsdf.lobes(), p.sg, omega_o, kGammaClosed).x;
      }
    }
    EXPECT_NEAR(sum / sg_mass(lambda), v.radiance, 2e-4 * v.radiance);
  }
}

}  // namespace
}  // namespace weft::shading
