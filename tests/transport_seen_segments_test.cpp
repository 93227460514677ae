#include <cmath>
#include <numeric>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "tests/transport_tiles.h"
#include "transport/bake_point.h"
#include "transport/seen_segments.h"

namespace weft::transport {
namespace {

TEST(TransportBakePoint, LiesAboveTheAxisWithinTheFibre) {
  const fabric::Tile tile = test::random_hairs(200, 0.4f, 0.3f, 0.15f, 5);
  const Scene scene(tile);
  for (std::uint32_t k = 0; k < tile.segment_count(); k += 7) {
    const BakePoint point = bake_point(scene, k);
    EXPECT_EQ(scene.tile_of(point.position_mm), glm::ivec2(0, 0));
    const fabric::Segment s = tile.segment(k);
    const glm::vec3 tangent = glm::normalize(s.b_mm - s.a_mm);
    glm::vec3 lift = point.position_mm - tile.wrapped_midpoint(k);
    for (int axis = 0; axis < 2; ++axis) {  // the point may have been wrapped
      lift[axis] -= std::round(lift[axis] / tile.size_mm[axis]) * tile.size_mm[axis];
    }
    EXPECT_GT(lift.z, 0);
    EXPECT_NEAR(glm::length(lift), 0.785398f * s.radius_mm, 1e-2f * s.radius_mm);
    EXPECT_NEAR(glm::dot(lift, tangent), 0, 1e-2f * s.radius_mm);
  }
}

// The own strand must be ignored by that name: nothing else is near a lonely fibre.
TEST(TransportBakePoint, NamesItsOwnStrandAcrossTheBorder) {
  fabric::Tile tile = test::empty_tile(1, 1);
  // Slanting down along x just inside the border: the point is lifted over it.
  test::add_strand(tile, {{0.8f, 0.5f, 0.2f}, {1.19f, 0.5f, -0.2f}}, 0.05f, 0, 0);
  test::finish(tile);
  const Scene scene(tile);
  const BakePoint point = bake_point(scene, 0);
  EXPECT_EQ(scene.tile_of(point.position_mm), glm::ivec2(0, 0));
  EXPECT_LT(point.position_mm.x, 0.5f);
  EXPECT_FALSE(scene.closest(point.position_mm, {0, 0, 1}, 1, point.own));
  EXPECT_FALSE(scene.closest(point.position_mm, {0, 0, -1}, 1, point.own));
}

// Upper layer of two: with gaps as wide as the fibres it hides half of the lower one from straight
// above and more from aslant.
TEST(TransportSeenSegments, CountWhatAnEyeMeets) {
  const fabric::Tile tile = test::crossed_layers(2, 8, 0.02f, 4);
  const Scene scene(tile);
  const auto seen = seen_segments(scene, 64, 3);
  ASSERT_EQ(seen.size(), tile.segment_count());
  std::uint64_t upper = 0;
  std::uint64_t lower = 0;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    (tile.wrapped_midpoint(k).z > 0.5f * (tile.z_min_mm + tile.z_max_mm) ? upper : lower) +=
        seen[k];
  }
  EXPECT_GT(lower, 0u);
  EXPECT_GT(upper, lower);
  EXPECT_LE(upper + lower, std::uint64_t{64} * seen.size());
  EXPECT_EQ(seen, seen_segments(scene, 64, 3));
  EXPECT_NE(seen, seen_segments(scene, 64, 4));
}

TEST(TransportSeenSegments, AreDrawnInProportion) {
  const std::vector<std::uint32_t> cells{0, 1, 0, 0, 1};
  const std::vector<std::uint32_t> seen{1, 0, 0, 3, 0};
  const auto by_cell = segments_by_cell(cells, 2, seen);
  ASSERT_EQ(by_cell.size(), 2u);
  std::array<int, 5> drawn{};
  core::Random random(9, 0);
  constexpr int kDraws = 40000;
  for (int i = 0; i < kDraws; ++i) {
    ++drawn[by_cell[0].draw(random)];
    ++drawn[by_cell[1].draw(random)];
  }
  EXPECT_EQ(drawn[2], 0);
  // Four standard deviations of a binomial.
  EXPECT_NEAR(drawn[0], kDraws / 4, 4 * std::sqrt(kDraws * 0.25 * 0.75));
  EXPECT_NEAR(drawn[1], kDraws / 2, 4 * std::sqrt(kDraws * 0.25));  // nobody sees cell 1: all alike
  EXPECT_EQ(drawn[0] + drawn[3], kDraws);
}

TEST(TransportSeenSegments, ADamagedGridIsRefused) {
  const std::vector<std::uint32_t> seen{1, 1};
  const auto refused = [&](const std::vector<std::uint32_t>& cells, std::size_t count) {
    EXPECT_THROW(static_cast<void>(segments_by_cell(cells, count, seen)), core::Error);
  };
  refused({0, 1}, 1);     // a cell that is not there
  refused({0, 0}, 2);     // an empty cell
  refused({0, 0, 0}, 1);  // one count too few
}

}  // namespace
}  // namespace weft::transport
