#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/moments.h"
#include "tests/transport_tiles.h"
#include "transport/shadow_spread.h"

namespace weft::transport {
namespace {

constexpr std::uint32_t kBins = 64;

SpreadSettings settings_with(double bin_mm) {
  SpreadSettings settings;
  settings.seed = 4;
  settings.bins = kBins;
  settings.bin_mm = bin_mm;
  return settings;
}

// Light nearer than bin `end`, and all of it.
double light_in(const SpreadSums& sums, std::size_t begin, std::size_t end) {
  double light = 0;
  for (std::size_t i = begin; i < end; ++i) {
    light += core::from_fixed_point(sums.sum[i]);
  }
  return light;
}

// Two bars along y in a tile of one millimetre, half a millimetre apart.
fabric::Tile two_bars() {
  fabric::Tile tile = test::empty_tile(1, 1);
  for (const float x : {0.25f, 0.75f}) {
    test::add_strand(tile, {{x, 0, 0}, {x, 0.5f, 0}, {x, 1, 0}}, 0.05f, 0, 1);
  }
  test::finish(tile);
  return tile;
}

fabric::Tile scaled(fabric::Tile tile, float scale) {
  tile.size_mm *= scale;
  for (fabric::Strand& strand : tile.strands) {
    strand.radius_mm *= scale;
  }
  for (glm::vec3& point : tile.points_mm) {
    point *= scale;
  }
  test::finish(tile);
  return tile;
}

TEST(ShadowSpread, AnySplitOfThePathsGivesTheSameSums) {
  const fabric::Tile tile = test::crossed_layers(4, 6, 0.05f, 4);
  const Scene scene(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf::furnace()};
  const SpreadSums whole = spread_sums(scene, materials, 0, 3000, settings_with(0.05));
  std::vector<std::int64_t> sum(kBins + 1, 0);
  for (const auto& [first, count] :
       std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 1}, {1, 700}, {701, 2299}}) {
    const SpreadSums part = spread_sums(scene, materials, first, count, settings_with(0.05));
    EXPECT_EQ(part.paths, count);
    for (std::size_t i = 0; i < sum.size(); ++i) {
      sum[i] += part.sum[i];
    }
  }
  EXPECT_EQ(sum, whole.sum);
  EXPECT_GT(light_in(whole, 0, kBins + 1), 100);
}

TEST(ShadowSpread, WithoutLossEveryPathThatLeavesUpwardsCountsOne) {
  // Bars hide each other from nothing but level light: what a bar scatters meets another or leaves.
  const fabric::Tile tile = two_bars();
  const Scene scene(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf::furnace()};
  const SpreadSums sums = spread_sums(scene, materials, 0, 20000, settings_with(0.05));
  const double light = light_in(sums, 0, kBins + 1);
  EXPECT_EQ(light, std::round(light));
  EXPECT_GT(light, 0);
  EXPECT_LT(light, 2 * 20000);
}

TEST(ShadowSpread, LightComesFromWhereOtherFibresAre) {
  const fabric::Tile tile = two_bars();
  const Scene scene(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf::furnace()};
  const SpreadSums sums = spread_sums(scene, materials, 0, 40000, settings_with(0.05));
  const double light = light_in(sums, 0, kBins + 1);
  // Half of the sums is by the distance across, where the next bar is half a millimetre away and
  // light leaves it at most two of its heights aside, but for the few that leave at a low angle.
  const double near = light_in(sums, 0, 5);
  EXPECT_GT(near, 0.1 * light);                            // along the bars
  EXPECT_LT(near, 0.52 * light);                           // nothing across
  EXPECT_GT(light_in(sums, 20, kBins + 1), 0.02 * light);  // beyond the tile: it is not wrapped
}

TEST(ShadowSpread, ItGrowsWithTheCloth) {
  const fabric::Tile small = test::crossed_layers(4, 6, 0.05f, 4);
  const fabric::Tile large = scaled(small, 2);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf::furnace()};
  const Scene small_scene(small);
  const Scene large_scene(large);
  const SpreadSums a = spread_sums(small_scene, materials, 0, 4000, settings_with(0.05));
  const SpreadSums b = spread_sums(large_scene, materials, 0, 4000, settings_with(0.1));
  for (const std::size_t end : {std::size_t{2}, std::size_t{8}, std::size_t{24}}) {
    EXPECT_NEAR(light_in(a, 0, end), light_in(b, 0, end), 0.01 * light_in(a, 0, kBins + 1)) << end;
  }
}

TEST(ShadowSpread, BlackFibresSpreadNothing) {
  const fabric::Tile tile = test::crossed_layers(4, 6, 0.05f, 4);
  const Scene scene(tile);
  shading::FibreMaterial black;
  black.c_r = glm::vec3(0);
  black.c_tt = glm::vec3(0);
  black.beta_r = black.beta_tt = 0.1f;
  black.gamma_tt = 0.3f;
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf(black)};
  const SpreadSums dark = spread_sums(scene, materials, 0, 4000, settings_with(0.05));
  const std::vector<shading::FibreBcsdf> white{shading::FibreBcsdf::furnace()};
  const SpreadSums light = spread_sums(scene, white, 0, 4000, settings_with(0.05));
  // Schlick's Fresnel term leaves a little at grazing angles.
  EXPECT_LT(light_in(dark, 0, kBins + 1), 0.02 * light_in(light, 0, kBins + 1));
}

TEST(ShadowSpread, CanBeStopped) {
  const fabric::Tile tile = two_bars();
  const Scene scene(tile);
  const std::vector<shading::FibreBcsdf> materials{shading::FibreBcsdf::furnace()};
  EXPECT_THROW(
      static_cast<void>(spread_sums(scene, materials, 0, 1000, settings_with(0.05),
                                    [] { throw core::Error(core::Code::kCancelled, "enough"); })),
      core::Error);
}

}  // namespace
}  // namespace weft::transport
