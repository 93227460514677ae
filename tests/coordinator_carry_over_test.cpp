#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "coordinator/versions/carry_over.h"
#include "coordinator/versions/sky_extension.h"
#include "core/error.h"
#include "core/half.h"
#include "shading/scattering_orders.h"
#include "shading/spherical_harmonics.h"
#include "tests/storage_test_database.h"

namespace weft::coordinator {
namespace {

using shading::kFirstOrder;
using shading::kOrderBins;

std::uint16_t half(double value) { return core::half_from_float(static_cast<float>(value)); }

// One cell of one material, order 0, whose light is known by orders of scattering: `light` of each
// bin, all in its first order, `reflected` of the scatterings by C_R and the rest by (1 - C_R)
// C_TT.
storage::RecolourableDatabase known_light(const std::vector<double>& light, double reflected) {
  storage::RecolourableDatabase fabric;
  storage::FabricDatabase& db = fabric.database;
  storage::Recolouring& orders = fabric.recolouring;
  db.material_names = {"one"};
  db.materials = {{{0.3F, 0.3F, 0.3F}, {0.6F, 0.6F, 0.6F}, 0.1F, 0.2F, 0.3F}};
  db.cell_paths = {100};
  double sum = 0;
  std::vector<double> shapes(shading::kOrderShapes);
  for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
    sum += light[bin];
    if (bin > 0) {
      shapes[shading::shape_of_bin(bin)] += light[bin];
    }
    const double n = kFirstOrder[bin];
    for (int c = 0; c < 3; ++c) {
      orders.order_light.push_back(half(light[bin]));
      for (const double count : {n, n * reflected, n * (1 - reflected)}) {
        orders.order_counts.push_back(half(count));
      }
    }
  }
  for (const double shape : shapes) {
    orders.order_shapes.push_back(half(shape));
  }
  db.transfer.assign(3, static_cast<float>(sum));
  db.transfer_se.assign(3, static_cast<float>(sum / 100));
  return fabric;
}

// Gives the fabric these colours.
void carry_over(storage::RecolourableDatabase& fabric,
                const std::vector<shading::FibreMaterial>& materials,
                const OrderLevels& levels = {}) {
  const LightCarrier carrier(fabric);
  CarriedMatrices carried = carrier.matrices(carrier.sums(materials, levels));
  fabric.database.transfer = std::move(carried.transfer);
  fabric.database.transfer_se = std::move(carried.transfer_se);
}

const std::vector<double> kLight{1, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0, 0, 0, 0};

TEST(CoordinatorCarryOver, OldColours_GiveTheOldMatricesToTheBit) {
  storage::RecolourableDatabase fabric{storage::small_database(), {}};
  const storage::FabricDatabase& db = fabric.database;
  storage::Recolouring& orders = fabric.recolouring;
  const std::size_t rows = db.cell_paths.size() * shading::order_groups(2) * kOrderBins * 3;
  orders.order_light.assign(rows, half(0.25));
  orders.order_counts.assign(rows * shading::order_counts(2), half(0.5));
  orders.order_shapes.assign(db.cell_paths.size() * shading::kOrderShapes * 16, half(0.1));
  const storage::FabricDatabase before = db;
  carry_over(fabric, before.materials);
  EXPECT_EQ(db.transfer, before.transfer);
  EXPECT_EQ(db.transfer_se, before.transfer_se);
}

TEST(CoordinatorCarryOver, LightOfOneLobe_GoesWithThePowerOfItsOrder) {
  storage::RecolourableDatabase fabric = known_light(kLight, 0);
  std::vector<shading::FibreMaterial> dark = fabric.database.materials;
  dark[0].c_tt *= 0.5F;
  carry_over(fabric, dark);
  double expected = 0;
  for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
    expected += kLight[bin] * std::pow(0.5, kFirstOrder[bin]);
  }
  for (const float value : fabric.database.transfer) {
    EXPECT_NEAR(value, expected, 1e-3 * expected);
  }
}

TEST(CoordinatorCarryOver, LightOfTwoLobes_GoesWithTheirMean) {
  const double reflected = 0.25;
  storage::RecolourableDatabase fabric = known_light(kLight, reflected);
  std::vector<shading::FibreMaterial> other = fabric.database.materials;
  other[0].c_r *= 0.5F;
  const shading::FibreMaterial& old = fabric.database.materials[0];
  std::vector<double> expected(3);
  for (int c = 0; c < 3; ++c) {
    const double passed = (1 - other[0].c_r[c]) / (1 - old.c_r[c]);
    const double q = reflected * 0.5 + (1 - reflected) * passed;
    for (std::size_t bin = 0; bin < kOrderBins; ++bin) {
      expected[static_cast<std::size_t>(c)] += kLight[bin] * std::pow(q, kFirstOrder[bin]);
    }
  }
  carry_over(fabric, other);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(fabric.database.transfer[c], expected[c], 2e-3 * expected[c]);
  }
}

TEST(CoordinatorCarryOver, EachChannel_ComesFromTheNearestOne) {
  storage::RecolourableDatabase fabric = known_light(kLight, 0.5);
  fabric.database.materials[0].c_r = {0.6F, 0.1F, 0.1F};
  fabric.database.materials[0].c_tt = {0.9F, 0.2F, 0.1F};
  fabric.database.transfer = {4, 2, 1};
  std::vector<shading::FibreMaterial> turned = fabric.database.materials;
  turned[0].c_r = {0.1F, 0.6F, 0.1F};
  turned[0].c_tt = {0.1F, 0.9F, 0.2F};
  carry_over(fabric, turned);
  EXPECT_EQ(fabric.database.transfer, (std::vector<float>{1, 4, 2}));
}

TEST(CoordinatorCarryOver, BrighterColours_NeverGiveDarkerLight) {
  double last = 0;
  for (const float share : {0.01F, 0.1F, 0.5F, 0.9F, 1.0F, 1.1F, 1.3F}) {
    storage::RecolourableDatabase fabric = known_light(kLight, 0.5);
    std::vector<shading::FibreMaterial> other = fabric.database.materials;
    other[0].c_tt *= share;
    carry_over(fabric, other);
    EXPECT_GT(fabric.database.transfer[0], last);
    last = fabric.database.transfer[0];
  }
}

TEST(CoordinatorCarryOver, ColoursOfWhichLittleFollows_GiveNoMoreLightThanThereIs) {
  // Many scatterings of a dark cloth, made white: a power of them would be a million times
  // brighter.
  storage::RecolourableDatabase fabric =
      known_light({1, 0.5, 0.4, 0.3, 0.2, 0.2, 0.2, 0.1, 0.1, 0.1, 0.1}, 0.3);
  std::vector<shading::FibreMaterial> white = fabric.database.materials;
  white[0].c_r = {0.7F, 0.7F, 0.7F};
  white[0].c_tt = {1, 1, 1};
  carry_over(fabric, white);
  for (const float value : fabric.database.transfer) {
    EXPECT_GT(value, 4);
    EXPECT_LE(value, 4.01 * std::numbers::pi);  // orders are halves
  }
}

TEST(CoordinatorCarryOver, WhatFewPathsTell_IsMixedWithWhatAllCellsDo) {
  // Two cells with the same light; one has the odd path that met one lobe only.
  storage::RecolourableDatabase fabric = known_light(kLight, 0.5);
  const storage::RecolourableDatabase other = known_light(kLight, 1);
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(fabric.recolouring.order_light, other.recolouring.order_light);
  append(fabric.recolouring.order_counts, other.recolouring.order_counts);
  append(fabric.recolouring.order_shapes, other.recolouring.order_shapes);
  fabric.database.cell_paths = {100, 100};
  MaterialGains gains(1);
  gains[0].transmit = 2;
  const auto last_part = [&](std::uint64_t paths) {
    fabric.database.cell_paths[1] = paths;
    return ScatteringTable(fabric).gains(1, 0, gains)[kOrderParts - 1];
  };
  // By its own paths nothing was transmitted, and the gain is 1; by all, 1.25^10.
  EXPECT_NEAR(last_part(10'000'000), 1, 0.01);
  EXPECT_NEAR(last_part(1), std::pow(1.25, 10), 0.2 * std::pow(1.25, 10));
  EXPECT_GT(last_part(5'000), 1.01);
}

TEST(CoordinatorCarryOver, Levels_MultiplyTheLightOfTheirOrders) {
  storage::RecolourableDatabase fabric = known_light(kLight, 0.5);
  std::vector<shading::FibreMaterial> other = fabric.database.materials;
  other[0].c_tt *= 0.9F;
  const LightCarrier carrier(fabric);
  OrderLevels levels;
  levels.of[1][2] = 1.5;
  const CarriedSums plain = carrier.sums(other);
  const CarriedSums levelled = carrier.sums(other, levels);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t part = 0; part < kOrderParts; ++part) {
      EXPECT_DOUBLE_EQ(levelled.light[c][part],
                       plain.light[c][part] * (c == 1 && part == 2 ? 1.5 : 1));
    }
  }
  const double added = levelled.light[1][2] - plain.light[1][2];
  EXPECT_NEAR(carrier.matrices(levelled).transfer[1] - carrier.matrices(plain).transfer[1], added,
              1e-3 * added);
}

TEST(CoordinatorCarryOver, HigherHarmonicsOfTheSky_FollowFromTheLower) {
  constexpr std::size_t kLow = 16;
  constexpr std::size_t kAll = 36;
  const std::vector<double> extension = sky_extension(5);
  ASSERT_EQ(extension.size(), kLow * (kAll - kLow));
  // Harmonics of what a tilted plane reflects of the sky, by sums over 200 x 200 directions.
  const glm::vec3 normal = glm::normalize(glm::vec3(0.3F, -0.2F, 1));
  std::array<double, kAll> found{};
  for (int i = 0; i < 200; ++i) {
    for (int k = 0; k < 200; ++k) {
      const double z = (i + 0.5) / 200;
      const double phi = 2 * std::numbers::pi * (k + 0.5) / 200;
      const double r = std::sqrt(1 - z * z);
      const glm::vec3 omega(glm::dvec3(r * std::cos(phi), r * std::sin(phi), z));
      const float light = std::max(0.0F, glm::dot(normal, omega));
      const shading::ShVector y = shading::sh_evaluate(omega);
      for (std::size_t j = 0; j < kAll; ++j) {
        found[j] += static_cast<double>(light * y.c[j]);
      }
    }
  }
  double squares = 0;
  double missed = 0;
  for (std::size_t high = kLow; high < kAll; ++high) {
    double value = 0;
    for (std::size_t low = 0; low < kLow; ++low) {
      value += extension[(high - kLow) * kLow + low] * found[low];
    }
    squares += found[high] * found[high];
    missed += (value - found[high]) * (value - found[high]);
  }
  EXPECT_LT(std::sqrt(missed / squares), 0.25);
  EXPECT_TRUE(sky_extension(3).empty());
}

core::Code refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const core::Error& error) {
    return error.code();
  }
  ADD_FAILURE() << "no error";
  return core::Code::kInternal;
}

TEST(CoordinatorCarryOver, WhatNothingFollowsFrom_IsRefused) {
  storage::RecolourableDatabase old{storage::small_database(), {}};
  EXPECT_EQ(refusal([&] { carry_over(old, storage::small_database().materials); }),
            core::Code::kFailedPrecondition);
  storage::RecolourableDatabase black = known_light(kLight, 0.5);
  const std::vector<shading::FibreMaterial> bright = black.database.materials;
  black.database.materials[0].c_tt = {0, 0, 0};
  EXPECT_EQ(refusal([&] { carry_over(black, bright); }), core::Code::kFailedPrecondition);
}

}  // namespace
}  // namespace weft::coordinator
