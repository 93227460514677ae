#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "shading/fibre_angle.h"

namespace weft::shading {
namespace {

TEST(FibreAngle, KeepsItsRelativePrecisionUpToTheAxis) {
  for (double pole = 1e-6; pole < std::numbers::pi / 2; pole *= 1.07) {
    for (const double side : {-1.0, 1.0}) {
      const vec3 w(static_cast<float>(side * std::cos(pole)),
                   static_cast<float>(std::sin(pole) * std::cos(2.0)),
                   static_cast<float>(std::sin(pole) * std::sin(2.0)));
      const FibreAngle a = fibre_angle(w);
      ASSERT_NEAR(a.pole, pole, 5e-7 * pole);
      ASSERT_NEAR(a.theta, side * (std::numbers::pi / 2 - pole), 3e-7);
      ASSERT_NEAR(a.cos_theta, std::sin(pole), 3e-7 * std::sin(pole));
    }
  }
}

TEST(FibreAngle, SinesAndCosinesMatchTheLibrary) {
  for (int k = -1000; k <= 1000; ++k) {
    const float quarter = static_cast<float>(k) / 1000 * kHalfPi;
    const double sine = std::sin(static_cast<double>(quarter));
    ASSERT_NEAR(sin_quarter(quarter), sine, 2e-7 * std::abs(sine));
    const float half = 2 * quarter;
    const vec2 turn = cos_sin_half(half);
    ASSERT_NEAR(turn.x, std::cos(static_cast<double>(half)), 3e-7);
    ASSERT_NEAR(turn.y, std::sin(static_cast<double>(half)), 3e-7);
  }
}

}  // namespace
}  // namespace weft::shading
