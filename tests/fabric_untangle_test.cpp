#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/fibre_pairs.h"
#include "fabric/fibres.h"
#include "fabric/section_packing.h"
#include "fabric/untangle.h"

namespace weft::fabric {
namespace {

constexpr const char* kSatin =
    R"(rows: "XXXX." rows: "X.XXX" rows: "XXX.X" rows: ".XXXX" rows: "XX.XX")";
constexpr const char* kPlain = R"(rows: "X." rows: ".X")";

v1::FabricDescription describe(const std::string& rows) {
  return parse_description(R"(
    name: "packed" seed: 3
    weave { matrix { )" + rows +
                               R"( } ends_per_cm: 25 picks_per_cm: 24
            warp_yarn: "y" weft_yarn: "y" }
    yarns { name: "y" material: "cotton" plies: 2 fibres_per_ply: 12 yarn_radius_mm: 0.19
            fibre_radius_mm: 0.022 ply_aspect: 0.7 flattening: 0.5
            hairs { per_mm: 1 length_mm: 0.4 length_sd_mm: 0.1 reach_mm: 0.1 reach_sd_mm: 0.05 } }
    exemplar { segment_length_radii: 6 })",
                           "packed.textproto", ".");
}

// A tile of straight strands along y, each as periodic as the tile.
Tile parallel_fibres(const std::vector<glm::dvec2>& places_mm, float radius_mm, float size_mm) {
  constexpr std::uint32_t kPoints = 9;
  Tile tile;
  tile.size_mm = {size_mm, size_mm};
  tile.material_names = {"m"};
  tile.yarn_names = {"y"};
  tile.threads = {{}};
  for (const glm::dvec2& place : places_mm) {
    tile.strands.push_back(
        {static_cast<std::uint32_t>(tile.points_mm.size()), kPoints, 0, 0, radius_mm, 0, 1});
    for (std::uint32_t k = 0; k + 1 < kPoints; ++k) {
      tile.points_mm.emplace_back(place.x, size_mm * static_cast<float>(k) / (kPoints - 1),
                                  place.y);
    }
    tile.points_mm.push_back(
        period_end(tile.points_mm[tile.strands.back().first_point], {0, 1}, tile.size_mm));
  }
  return tile;
}

TEST(Untangle, FibresOfClothHardlyOverlap) {
  for (const char* rows : {kPlain, kSatin}) {
    UntangleReport report;
    const Tile tile = build_tile(describe(rows), {.untangled = &report});
    EXPECT_LT(report.buried_share, kBuriedTolerance);
    EXPECT_EQ(report.buried_share, buried_share(tile));
    EXPECT_GT(report.mean_moved_mm, 0);
    EXPECT_LT(report.mean_moved_mm, 0.19) << "the yarns are no longer what they were";
    for (const Strand& strand : tile.strands) {
      const glm::vec3 first = tile.points_mm[strand.first_point];
      const glm::vec3 last = tile.points_mm[strand.first_point + strand.point_count - 1];
      if (strand.period_x != 0 || strand.period_y != 0) {
        EXPECT_EQ(last, period_end(first, {strand.period_x, strand.period_y}, tile.size_mm));
      }
    }
    for (const glm::vec3& point : tile.points_mm) {
      EXPECT_TRUE(std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z));
    }
  }
}

// Fibres through each other at random, 40 % of the space full: what parts them bends them little.
TEST(Untangle, FibresStaySmooth) {
  core::Random random(1, 0);
  std::vector<glm::dvec2> places;
  for (int n = 0; n < 60; ++n) {
    places.emplace_back(random.uniform_double(), 0.3 * random.uniform_double());
  }
  Tile tile = parallel_fibres(places, 0.025F, 1);
  for (Strand& strand : tile.strands) {
    const double phase = 6 * random.uniform_double();
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      const double angle = 2 * std::numbers::pi * (p % (strand.point_count - 1)) / 8 + phase;
      tile.points_mm[strand.first_point + p].x += static_cast<float>(0.03 * std::cos(angle));
    }
  }
  EXPECT_GT(buried_share(tile), 0.3);
  EXPECT_LT(untangle(tile).buried_share, kBuriedTolerance);
  std::vector<double> bends;
  for (const Strand& strand : tile.strands) {
    for (std::uint32_t p = 1; p + 1 < strand.point_count; ++p) {
      const glm::vec3 at = tile.points_mm[strand.first_point + p];
      const glm::vec3 before = at - tile.points_mm[strand.first_point + p - 1];
      const glm::vec3 after = tile.points_mm[strand.first_point + p + 1] - at;
      bends.push_back(
          std::acos(std::min(1.0F, glm::dot(glm::normalize(before), glm::normalize(after)))));
    }
  }
  std::sort(bends.begin(), bends.end());
  const double degree = std::numbers::pi / 180;
  EXPECT_LT(bends[bends.size() / 2], 15 * degree);
  EXPECT_LT(bends[bends.size() * 99 / 100], 40 * degree);
}

TEST(Untangle, IsTheSameEveryTimeOnAnyNumberOfThreads) {
  const std::string alone = encode_tile(build_tile(describe(kPlain), {.most_threads = 1}));
  EXPECT_EQ(encode_tile(build_tile(describe(kPlain), {.most_threads = 1})), alone);
  EXPECT_EQ(encode_tile(build_tile(describe(kPlain), {.most_threads = 2})), alone);
  EXPECT_EQ(encode_tile(build_tile(describe(kPlain), {.most_threads = 7})), alone);
}

TEST(Untangle, FibresWithRoomStayWhereTheyAre) {
  const Tile laid = parallel_fibres({{0.2, 0}, {0.5, 0}, {0.8, 0.3}}, 0.1F, 1);
  Tile moved = laid;
  const UntangleReport report = untangle(moved);
  EXPECT_EQ(report.buried_share, 0);
  EXPECT_EQ(moved.points_mm, laid.points_mm);
}

TEST(Untangle, CoincidingFibresPart) {
  Tile tile = parallel_fibres({{0.5, 0}, {0.5, 0}}, 0.05F, 1);
  EXPECT_EQ(buried_share(tile), 1);
  EXPECT_EQ(untangle(tile).buried_share, 0);
  EXPECT_GT(glm::distance(tile.points_mm.front(), tile.points_mm.back()), 0.06F);
}

// One fibre alone in a tile narrower than itself lies inside its own lateral copies.
TEST(Untangle, LateralCopiesAreOtherFibres) {
  EXPECT_EQ(buried_share(parallel_fibres({{0.5, 0}}, 0.3F, 1)), 0);
  Tile narrow = parallel_fibres({{0.5, 0}}, 0.3F, 1);
  narrow.size_mm.x = 0.25F;
  EXPECT_EQ(buried_share(narrow), 1);
}

TEST(Untangle, ClosePairsAreThoseOfAllPairs) {
  const Tile tile = build_tile(describe(kPlain));
  const FibreBody body(tile);
  const double margin = 0.01;
  std::vector<FibrePair> all;
  for (std::uint32_t u = 0; u < body.pieces.size(); u += 7) {
    for (std::uint32_t v = 0; v < body.pieces.size(); ++v) {
      for (int x = -2; x <= 2; ++x) {
        for (int y = -2; y <= 2; ++y) {
          const glm::ivec2 period = body.strand_periods[body.pieces[u].strand];
          const bool same = body.pieces[u].strand == body.pieces[v].strand &&
                            x * period.y == y * period.x &&
                            (period != glm::ivec2(0, 0) || (x == 0 && y == 0));
          if (!same) {
            all.push_back({u, v, {x, y}});
          }
        }
      }
    }
  }
  std::size_t expected = 0;
  Approaches approaches;
  for (std::span<const FibrePair> left = all; !left.empty();) {
    const std::size_t count = approaches.measure(body, left);
    for (std::size_t i = 0; i < count; ++i) {
      const double near =
          body.pieces[left[i].u].radius_mm + body.pieces[left[i].v].radius_mm + margin;
      expected += approaches.gap2(i) < near * near ? 1 : 0;
    }
    left = left.subspan(count);
  }
  std::size_t found = 0;
  for (const FibrePair& pair : close_pairs(body, margin)) {
    found += (pair.u % 7 == 0 ? 1 : 0) + (pair.v % 7 == 0 ? 1 : 0);
  }
  EXPECT_GT(expected, 1000U);
  EXPECT_EQ(found, expected);
}

TEST(Untangle, ApproachesAreTheNearestOfManyPlaces) {
  const Tile tile = build_tile(describe(kPlain));
  const FibreBody body(tile);
  const auto count = static_cast<std::uint32_t>(body.pieces.size());
  std::vector<FibrePair> pairs;
  for (std::uint32_t n = 0; n < 100; ++n) {
    pairs.push_back({n * 31 % count, n * 17 % count, {n % 3 == 0 ? 1 : 0, 0}});
  }
  pairs.push_back({0, 0, {0, 1}});  // parallel
  Approaches approaches;
  for (std::span<const FibrePair> left = pairs; !left.empty();) {
    const std::size_t measured = approaches.measure(body, left);
    ASSERT_EQ(measured, std::min(left.size(), Approaches::kCount));
    for (std::size_t i = 0; i < measured; ++i) {
      const FibreBody::Piece& u = body.pieces[left[i].u];
      const FibreBody::Piece& v = body.pieces[left[i].v];
      const glm::dvec3 copy(left[i].copy.x * body.size_mm.x, left[i].copy.y * body.size_mm.y, 0);
      const auto gap = [&](double at_u, double at_v) {
        return glm::mix(body.begin_mm(v), body.end_mm(v), at_v) + copy -
               glm::mix(body.begin_mm(u), body.end_mm(u), at_u);
      };
      double nearest = 1e300;
      constexpr int kSteps = 50;
      for (int a = 0; a <= kSteps; ++a) {
        for (int b = 0; b <= kSteps; ++b) {
          nearest = std::min(nearest, glm::length(gap(a / double{kSteps}, b / double{kSteps})));
        }
      }
      const Approach approach = approaches[i];
      EXPECT_NEAR(glm::length(approach.gap_mm - gap(approach.at_u, approach.at_v)), 0, 1e-12);
      EXPECT_NEAR(std::sqrt(approaches.gap2(i)), glm::length(approach.gap_mm), 1e-12);
      const double step = glm::length(body.end_mm(u) - body.begin_mm(u)) / kSteps;
      EXPECT_LE(glm::length(approach.gap_mm), nearest + 1e-12);
      EXPECT_GE(glm::length(approach.gap_mm), nearest - 2 * step);
    }
    left = left.subspan(measured);
  }
}

TEST(Untangle, PointsInASectionKeepApart) {
  std::vector<glm::dvec2> points;
  for (int n = 0; n < 40; ++n) {
    const double radius = std::sqrt((n + 0.5) / 40);
    points.emplace_back(2 * radius * std::cos(1.7 * n * n), radius * std::sin(1.7 * n * n));
  }
  spread_in_ellipse(points, {2, 1}, 0.3);
  double nearest = 1e300;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_LE(glm::length(points[i] / glm::dvec2(2, 1)), 1 + 1e-9);
    for (std::size_t j = 0; j < i; ++j) {
      nearest = std::min(nearest, glm::distance(points[i], points[j]));
    }
  }
  EXPECT_GT(nearest, 0.27);
}

}  // namespace
}  // namespace weft::fabric
