#include <cmath>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/map_sample.h"
#include "render/material_maps.h"
#include "render/sheen_fit.h"
#include "render/surface_lobe.h"
#include "tests/render_random_fabric.h"

namespace weft::render {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::shared_ptr<const Fabric> fabric_of_one_material() {
  RandomFabric wanted;
  wanted.materials = 1;
  return random_fabric(wanted);
}

MaterialMaps baked(const Fabric& fabric, std::uint32_t side, unsigned threads = 1) {
  MapSettings settings;
  settings.width = side;
  settings.height = side;
  settings.samples = 16;
  settings.threads = threads;
  return bake_maps(
      fabric, settings, [](double) {}, [] { return false; });
}

// Mean steps between neighbours within a picture, across and along, and over its seams.
struct Steps {
  double within[2] = {0, 0};
  double over_seam[2] = {0, 0};
};

template <class Values, class Distance>
Steps steps_of(const Values& values, std::uint32_t side, const Distance& distance) {
  Steps steps;
  const auto at = [&](std::uint32_t x, std::uint32_t y) { return values[y * side + x]; };
  for (std::uint32_t j = 0; j < side; ++j) {
    for (std::uint32_t i = 0; i < side; ++i) {
      const double right = distance(at(i, j), at((i + 1) % side, j)) / side;
      const double down = distance(at(j, i), at(j, (i + 1) % side)) / side;
      if (i + 1 == side) {
        steps.over_seam[0] += right;
        steps.over_seam[1] += down;
      } else {
        steps.within[0] += right / (side - 1);
        steps.within[1] += down / (side - 1);
      }
    }
  }
  return steps;
}

TEST(MaterialMaps, SeamsAreNoSteeperThanWhatLiesWithin) {
  const auto fabric = fabric_of_one_material();
  constexpr std::uint32_t kSide = 32;
  const MaterialMaps maps = baked(*fabric, kSide);
  const auto number = [](float a, float b) { return static_cast<double>(std::fabs(a - b)); };
  const auto vector = [](auto a, auto b) { return static_cast<double>(glm::distance(a, b)); };
  // Fibres lie in the same place of every eighth of this tile: its greatest step within is a bound.
  const auto check = [](const Steps& steps, const char* what) {
    for (int axis = 0; axis < 2; ++axis) {
      EXPECT_LE(steps.over_seam[axis], 2 * steps.within[axis] + 1e-6) << what << axis;
    }
  };
  check(steps_of(maps.height_mm, kSide, number), "height ");
  check(steps_of(maps.normal, kSide, vector), "normal ");
  check(steps_of(maps.coverage, kSide, number), "coverage ");
  check(steps_of(maps.roughness, kSide, number), "roughness ");
  check(steps_of(maps.transmission, kSide, number), "transmission ");
}

TEST(MaterialMaps, AreTheSameOnAnyNumberOfThreadsAndStopWhenTold) {
  const auto fabric = fabric_of_one_material();
  const MaterialMaps one = baked(*fabric, 12, 1);
  const MaterialMaps three = baked(*fabric, 12, 3);
  EXPECT_EQ(one.base_colour, three.base_colour);
  EXPECT_EQ(one.normal, three.normal);
  EXPECT_EQ(one.transmission, three.transmission);
  EXPECT_EQ(one.reflection, three.reflection);
  EXPECT_EQ(one.sheen_colour, three.sheen_colour);
  MapSettings settings;
  settings.width = settings.height = 8;
  EXPECT_THROW(static_cast<void>(bake_maps(
                   *fabric, settings, [](double) {}, [] { return true; })),
               core::Error);
}

TEST(MaterialMaps, HeightAndNormalAreThoseOfTheFibres) {
  // Upper fibres of radius 0.04 along y at z = 0.04, every 1/8 mm from 1/16 on; gaps of 0.045 mm
  // show the lower ones along x at z = -0.04.
  const auto fabric = fabric_of_one_material();
  const MapEye eye(*fabric);
  const glm::vec3 up(0, 0, 1);
  for (const float off : {-0.03f, 0.0f, 0.02f}) {
    const auto seen = eye.look({0.0625f + off, 0.3f}, up);
    ASSERT_TRUE(seen.has_value());
    EXPECT_NEAR(seen->z_mm, 0.04f + std::sqrt(0.0016f - off * off), 1e-4f);
    EXPECT_NEAR(seen->normal.x, off / 0.04f, 1e-3f);
    EXPECT_NEAR(seen->normal.y, 0, 1e-3f);
    EXPECT_NEAR(std::fabs(seen->tangent.y), 1, 1e-6f);
  }
  const auto below = eye.look({0.125f, 0.0625f + 0.01f}, up);
  ASSERT_TRUE(below.has_value());
  EXPECT_NEAR(below->z_mm, -0.04f + std::sqrt(0.0016f - 0.0001f), 1e-4f);
  EXPECT_NEAR(std::fabs(below->tangent.x), 1, 1e-6f);
  EXPECT_FALSE(eye.look({0.125f, 0.125f}, up).has_value());  // a hole
}

TEST(MaterialMaps, CoverageAndTheWayAcrossAreThoseOfTheFibres) {
  const MaterialMaps maps = baked(*fabric_of_one_material(), 32);
  double covered = 0;
  for (const float share : maps.coverage) {
    covered += static_cast<double>(share) / static_cast<double>(maps.coverage.size());
  }
  const double gap = 1 - 8 * 0.08;  // of either layer
  EXPECT_NEAR(covered, 1 - gap * gap, 0.01);
  // Pixel 2 of row 2 lies over the first upper fibre, which runs along y: across it is x.
  EXPECT_NEAR(std::fabs(maps.across[2 * 32 + 2].x), 1, 1e-2f);
  for (std::size_t i = 0; i < maps.roughness.size(); ++i) {
    EXPECT_NEAR(glm::length(maps.normal[i]), 1, 1e-5f);
    EXPECT_NEAR(glm::length(maps.across[i]), 1, 1e-5f);
    EXPECT_GE(maps.roughness[i], 0);
    EXPECT_LE(maps.roughness[i], 1);
    EXPECT_LE(maps.anisotropy[i], 1);
    EXPECT_GE(maps.transmission[i], 0);
  }
}

TEST(SurfaceLobe, GgxWidthsComeBackFromTheirVariances) {
  // The mean by quadrature of D cos over sin^2 = s: the density of s is a / (a + (1 - a) s)^2.
  for (const double alpha : {0.05, 0.2, 0.5, 0.9, 1.0}) {
    const double a = alpha * alpha;
    double mean = 0;
    constexpr int kSteps = 200000;
    for (int i = 0; i < kSteps; ++i) {
      const double s = (i + 0.5) / kSteps;
      mean += a * s / ((a + (1 - a) * s) * (a + (1 - a) * s)) / kSteps;
    }
    EXPECT_NEAR(ggx_squared_sine(alpha), mean, 1e-5);
    EXPECT_NEAR(ggx_width(0.5 * mean), alpha, 1e-3);
  }
  EXPECT_EQ(ggx_width(1), 1);
  EXPECT_EQ(ggx_width(-1), 0.01);
}

TEST(SurfaceLobe, ItsAxisIsThatOfTheGreaterVariance) {
  const double angle = 0.4;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const double great = 0.2;
  const double small = 0.01;
  const SurfaceLobe lobe = surface_lobe(great * c * c + small * s * s, (great - small) * c * s,
                                        great * s * s + small * c * c);
  EXPECT_NEAR(std::fabs(lobe.across.x * c + lobe.across.y * s), 1, 1e-6);
  const double along = static_cast<double>(lobe.roughness * lobe.roughness);
  EXPECT_NEAR(along, ggx_width(small), 1e-6);
  const double strength = static_cast<double>(lobe.anisotropy);
  EXPECT_NEAR(along + strength * strength * (1 - along), ggx_width(great), 1e-6);
}

TEST(SheenFit, FindsTheSheenThatAnglesWereMadeWith) {
  const glm::dvec3 base(0.3, 0.2, 0.1);
  const glm::dvec3 colour(0.4, 0.3, 0.1);
  constexpr double kRoughness = 0.45;
  std::vector<SkyAlbedo> seen{{0, base}};
  for (const double degrees : {30.0, 50.0, 65.0, 75.0, 82.0}) {
    const double lobe = sheen_albedo(std::cos(degrees * kPi / 180), kRoughness);
    seen.push_back({degrees * kPi / 180, colour * lobe + base * (1 - colour.x * lobe)});
  }
  const Sheen sheen = fit_sheen(seen);
  EXPECT_NEAR(sheen.roughness, kRoughness, 1e-9);
  EXPECT_NEAR(glm::distance(sheen.colour, colour), 0, 1e-6);
}

TEST(SheenFit, ClothThatDarkensAslantHasNone) {
  const Sheen sheen =
      fit_sheen(std::vector<SkyAlbedo>{{0, glm::dvec3(0.5)}, {1.2, glm::dvec3(0.3)}});
  EXPECT_EQ(sheen.colour, glm::dvec3(0));
}

TEST(SheenFit, TheLobeOfALargeRoughnessIsThatOfItsFormula) {
  // Roughness 1 from straight above: D = 3 sin(theta_h) / (2 pi), theta_h half of theta_l, and
  // V = 1 / 4, so that the albedo is the integral over z = cos(theta_l) of 3/4 z sin(theta_l / 2).
  double expected = 0;
  constexpr int kSteps = 100000;
  for (int i = 0; i < kSteps; ++i) {
    const double z = (i + 0.5) / kSteps;
    expected += 0.75 * z * std::sqrt(0.5 * (1 - z)) / kSteps;
  }
  EXPECT_NEAR(sheen_albedo(1, 1), expected, 1e-3);
}

}  // namespace
}  // namespace weft::render
