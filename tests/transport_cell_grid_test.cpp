#include <cmath>
#include <map>
#include <numbers>

#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/transport_tiles.h"
#include "transport/cell_grid.h"
#include "transport/sphere.h"

namespace weft::transport {
namespace {

// Straight fibres in isotropic directions at independent places: a fibre of infinite length is
// modelled by an open one that crosses the whole slab many times over.
fabric::Tile isotropic_needles(int count, float length, float radius) {
  fabric::Tile tile = test::empty_tile(1, 1);
  for (int i = 0; i < count; ++i) {
    core::Random random(17, static_cast<std::uint32_t>(i));
    const glm::vec3 at{random.uniform(), random.uniform(), random.uniform()};
    const glm::vec3 half = 0.5f * length * test::random_direction(random);
    test::add_strand(tile, {at - half, at + half}, radius, 0, 0);
  }
  test::finish(tile);
  return tile;
}

TEST(TransportMeanFreePath, MatchesThePoissonCylinderProcess) {
  // Needles with midpoints in a cube: the density of length is uniform in its middle only, so the
  // flights are started there by hand. 1 / path = pi r L_v / 2 for the lateral surface.
  constexpr int kCount = 4000;
  constexpr float kLength = 0.25f;
  constexpr float kRadius = 0.01f;
  fabric::Tile tile = isotropic_needles(kCount, kLength, kRadius);
  const Scene scene(tile);
  const double expected = 2 / (std::numbers::pi * kRadius * kCount * kLength);
  double flown = 0;
  int hits = 0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    core::Random random(3, i);
    const glm::vec3 origin{random.uniform(), random.uniform(), 0.3f + 0.4f * random.uniform()};
    const glm::vec3 direction = test::random_direction(random);
    const float limit = 0.15f;
    if (scene.occluded(origin, direction, 1e-6f, std::nullopt)) {
      continue;  // starts inside a fibre
    }
    const auto hit = scene.closest(origin, direction, limit, std::nullopt);
    flown += hit ? hit->t_mm : limit;
    hits += hit ? 1 : 0;
  }
  // The void's share and the needles' ends change it by some percent.
  EXPECT_NEAR(flown / hits / expected, 1.0, 0.08);
}

TEST(TransportMeanFreePath, IsTheSumOfFlightsOverHits) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 4);
  const Scene scene(tile);
  // An independent estimate: the same definition, another seed and its own loop.
  double flown = 0;
  int hits = 0;
  constexpr int kRays = 40000;
  for (std::uint32_t i = 0; i < kRays; ++i) {
    core::Random random(99, i, 1);
    const std::uint32_t k = random.below(tile.segment_count());
    const glm::vec3 direction = test::random_direction(random);
    const glm::vec3 origin = tile.wrapped_midpoint(k);
    const float limit =
        ((direction.z > 0 ? tile.z_max_mm : tile.z_min_mm) - origin.z) / direction.z;
    const auto hit = scene.closest(origin, direction, limit, scene.own_copy(k));
    flown += hit ? hit->t_mm : limit;
    hits += hit ? 1 : 0;
  }
  const double path = mean_free_path(scene, kRays, 1);
  EXPECT_NEAR(path / (flown / hits), 1.0, 4 * std::sqrt(2.0 / hits));
  EXPECT_EQ(path, mean_free_path(scene, kRays, 1));
  EXPECT_NE(path, mean_free_path(scene, kRays, 2));
}

TEST(TransportCellGrid, CoversEverySegmentOnceAndListsOnlyFullCells) {
  fabric::Tile tile = test::random_hairs(200, 0.6f, 0.4f, 0.2f, 4);
  tile.blocks = {3, 2};
  const CellGrid grid = make_cell_grid(tile, 0.07);
  // Blocks are 0.2 x 0.2: three cells each way.
  EXPECT_EQ(grid.cells_per_axis.x, 9u);
  EXPECT_EQ(grid.cells_per_axis.y, 6u);
  ASSERT_EQ(grid.cell_of_segment.size(), tile.segment_count());
  std::vector<int> members(grid.cell_coordinates.size());
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    ASSERT_LT(grid.cell_of_segment[k], grid.cell_coordinates.size());
    ++members[grid.cell_of_segment[k]];
    const glm::vec3 at = tile.wrapped_midpoint(k);
    const glm::uvec3 cell = grid.cell_coordinates[grid.cell_of_segment[k]];
    const glm::vec3 size{
        0.6f / 9, 0.4f / 6,
        (tile.z_max_mm - tile.z_min_mm) / static_cast<float>(grid.cells_per_axis.z)};
    const glm::vec3 inside = (at - glm::vec3{0, 0, tile.z_min_mm}) / size - glm::vec3(cell);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GE(inside[axis], -1e-4f);
      EXPECT_LE(inside[axis], 1.0001f);
    }
  }
  for (const int count : members) {
    EXPECT_GT(count, 0);
  }
}

TEST(TransportCellGrid, LongPaths_GiveOneCellPerBlock) {
  fabric::Tile tile = test::crossed_layers(2, 4, 0.02f, 4);
  tile.blocks = {2, 1};
  const CellGrid grid = make_cell_grid(tile, 100);
  EXPECT_EQ(grid.cells_per_axis, glm::uvec3(2, 1, 1));
  EXPECT_EQ(grid.cell_coordinates.size(), 2u);
}

}  // namespace
}  // namespace weft::transport
