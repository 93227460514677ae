#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "shading/visibility.h"
#include "storage/light_tables.h"

namespace weft::storage {
namespace {

// A_1 = coth(lambda) - 1 / lambda and A_2 = 1 - 3 A_1 / lambda in closed form.
TEST(LightTables, ZonalTableHasTheClosedFormsOfTheLowBands) {
  const std::vector<float> sharpness = zonal_sharpnesses();
  const std::vector<float> table = zonal_table(2);
  ASSERT_EQ(table.size(), kZonalSharpnesses * 3);
  EXPECT_EQ(sharpness.front(), 1.0F);
  EXPECT_EQ(sharpness.back(), 1e4F);
  for (std::size_t i = 0; i < kZonalSharpnesses; ++i) {
    const double lambda = sharpness[i];
    const double a1 = 1 / std::tanh(lambda) - 1 / lambda;
    const double a2 = 1 - 3 * a1 / lambda;
    EXPECT_NEAR(table[3 * i], std::sqrt(1 / (4 * std::numbers::pi)), 1e-6);
    EXPECT_NEAR(table[3 * i + 1], std::sqrt(3 / (4 * std::numbers::pi)) * a1, 1e-6) << lambda;
    EXPECT_NEAR(table[3 * i + 2], std::sqrt(5 / (4 * std::numbers::pi)) * a2, 2e-6) << lambda;
  }
}

TEST(LightTables, ScatteringTablesFollowTheMaterials) {
  const shading::FibreMaterial dark{{0, 0, 0}, {0, 0, 0}, 0.1F, 0.2F, 0.3F};
  const shading::FibreMaterial white{{1, 1, 1}, {1, 1, 1}, 0.1F, 0.2F, 0.3F};
  const std::vector<float> tables = scattering_tables({dark, white}, 1);
  const std::size_t one = std::size_t{3} * 512 * 4;
  ASSERT_EQ(tables.size(), 2 * one);
  // sqrt(4 pi) C_S[theta_o, 0] is the adjoint albedo; of a lossless lobe and theta_o = 0 about 1.
  const std::size_t middle = std::size_t{255} * 4;
  EXPECT_NEAR(std::sqrt(4 * std::numbers::pi) * tables[one + middle], 1.0, 0.05);
  EXPECT_LT(tables[middle], 0.2F * tables[one + middle]);
}

TEST(LightTables, AxesAreThoseOfTheShadedVisibility) {
  const std::vector<float> axes = unrotated_sg_axes(48);
  for (int q = 0; q < 48; ++q) {
    const glm::vec3 axis = shading::fibonacci_axis(q, 48, 0.0F);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(axes[static_cast<std::size_t>(3 * q + i)], axis[i], 2e-5) << q;
    }
  }
}

}  // namespace
}  // namespace weft::storage
