#include <cmath>
#include <map>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/fibres.h"

namespace weft::fabric {
namespace {

constexpr const char* kMaterial = R"(
  materials { name: "m" c_r { r: 0.2 g: 0.2 b: 0.2 } c_tt { r: 0.5 g: 0.5 b: 0.5 }
    beta_r_deg: 10 beta_tt_deg: 20 gamma_tt_deg: 30 }
)";

constexpr const char* kPlainYarn = R"(
  yarns { name: "y" material: "m" plies: 2 fibres_per_ply: 20 yarn_radius_mm: 0.1
    fibre_radius_mm: 0.008 ply_twist_per_cm: 12 fibre_twist_per_cm: -20 }
)";

v1::FabricDescription describe(const std::string& text) {
  return parse_description("name: \"t\"\nseed: 7\n" + text + kMaterial, "test.textproto", ".");
}

std::string weave(const std::string& rows, double per_cm = 40) {
  return "weave { matrix { " + rows + " } ends_per_cm: " + std::to_string(per_cm) +
         " picks_per_cm: " + std::to_string(per_cm) + " warp_yarn: \"y\" weft_yarn: \"y\" }\n";
}

v1::FabricDescription plain() { return describe(weave(R"(rows: "X." rows: ".X")") + kPlainYarn); }

TEST(BuildTile, GivesTheSameBytesEveryTime) {
  const v1::FabricDescription description = plain();
  EXPECT_EQ(encode_tile(build_tile(description)), encode_tile(build_tile(description)));
}

TEST(BuildTile, GivesOtherFibresForAnotherSeed) {
  v1::FabricDescription description = plain();
  const std::string first = encode_tile(build_tile(description));
  description.set_seed(8);
  EXPECT_NE(first, encode_tile(build_tile(description)));
}

TEST(BuildTile, LaysEveryFibreOfEveryThread) {
  v1::FabricDescription description = plain();
  description.mutable_exemplar()->set_repeats_x(3);
  const Tile tile = build_tile(description);
  EXPECT_EQ(tile.threads.size(), 6U + 2U);
  EXPECT_EQ(tile.strands.size(), (6U + 2U) * 2U * 20U);
  EXPECT_EQ(tile.blocks, glm::uvec2(3, 1));
  EXPECT_FLOAT_EQ(tile.size_mm.x, 1.5F);
  EXPECT_FLOAT_EQ(tile.size_mm.y, 0.5F);
}

TEST(BuildTile, EndsPeriodicStrandsExactlyOnePeriodOn) {
  v1::FabricDescription description = plain();
  description.mutable_exemplar()->set_repeats_y(2);
  const Tile tile = build_tile(description);
  for (const Strand& strand : tile.strands) {
    const Role role = tile.threads[strand.thread].role;
    EXPECT_EQ(strand.period_x, role == Role::kWarp ? 0 : 1);
    EXPECT_EQ(strand.period_y, role == Role::kWarp ? 1 : 0);
    const glm::vec3 first = tile.points_mm[strand.first_point];
    const glm::vec3 last = tile.points_mm[strand.first_point + strand.point_count - 1];
    EXPECT_EQ(last, period_end(first, {strand.period_x, strand.period_y}, tile.size_mm));
  }
}

TEST(BuildTile, JoinsTheSeamAsSmoothlyAsTheRest) {
  const Tile tile = build_tile(plain());
  for (const Strand& strand : tile.strands) {
    const std::uint32_t last = strand.first_point + strand.point_count - 1;
    float longest = 0;
    float shortest = 1e9F;
    for (std::uint32_t p = strand.first_point; p < last; ++p) {
      const float length = glm::distance(tile.points_mm[p], tile.points_mm[p + 1]);
      longest = std::max(longest, length);
      shortest = std::min(shortest, length);
    }
    EXPECT_LT(longest, 4 * shortest);
  }
}

// The mean height of a thread's points near a crossing.
double height_at(const Tile& tile, std::uint32_t thread, glm::vec2 place) {
  double sum = 0;
  int count = 0;
  for (const Strand& strand : tile.strands) {
    for (std::uint32_t p = 0; strand.thread == thread && p + 1 < strand.point_count; ++p) {
      const glm::vec3 point = tile.points_mm[strand.first_point + p];
      const glm::vec2 away = glm::vec2(point) - place;
      const glm::vec2 near = away - glm::round(away / tile.size_mm) * tile.size_mm;
      if (std::abs(near.x) < 0.12F && std::abs(near.y) < 0.12F) {
        sum += point.z;
        ++count;
      }
    }
  }
  EXPECT_GT(count, 0);
  return sum / count;
}

TEST(BuildTile, PutsTheWarpOnTopWhereTheDraftSaysSo) {
  const Tile tile =
      build_tile(describe(weave(R"(rows: "XX." rows: ".XX" rows: "X.X")") + kPlainYarn));
  const char* rows[] = {"XX.", ".XX", "X.X"};
  for (std::uint32_t pick = 0; pick < 3; ++pick) {
    for (std::uint32_t end = 0; end < 3; ++end) {
      const glm::vec2 place{(static_cast<float>(end) + 0.5F) * 0.25F,
                            (static_cast<float>(pick) + 0.5F) * 0.25F};
      const double warp = height_at(tile, end, place);
      const double weft = height_at(tile, 3 + pick, place);
      EXPECT_EQ(warp > weft, rows[pick][end] == 'X') << "pick " << pick << " end " << end;
      EXPECT_GT(std::abs(warp - weft), 0.08);
    }
  }
}

TEST(BuildTile, KeepsCoverWithFewerThickerFibres) {
  v1::FabricDescription description = plain();
  const Tile full = build_tile(description);
  description.mutable_exemplar()->set_fibre_share(0.25);
  const Tile share = build_tile(description);
  EXPECT_EQ(share.strands.size() * 4, full.strands.size());
  EXPECT_FLOAT_EQ(share.strands[0].radius_mm, 2 * full.strands[0].radius_mm);
}

TEST(BuildTile, RefusesFibresThatDoNotFitTheirPly) {
  try {
    (void)build_tile(describe(weave(R"(rows: "X." rows: ".X")") +
                              R"(yarns { name: "y" material: "m" plies: 1 fibres_per_ply: 100
                                 yarn_radius_mm: 0.1 fibre_radius_mm: 0.02 })"));
    FAIL() << "was not refused";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("yarn 'y'"), std::string::npos) << error.what();
  }
}

TEST(BuildTile, RefusesASettWithoutRoomForTheYarns) {
  EXPECT_THROW((void)build_tile(describe(weave(R"(rows: "X." rows: ".X")", 90) + kPlainYarn)),
               core::Error);
}

TEST(BuildTile, RefusesATileOverTheLimitBeforeAnyWork) {
  v1::FabricDescription description = plain();
  description.mutable_exemplar()->set_repeats_x(4000);
  description.mutable_exemplar()->set_repeats_y(4000);
  try {
    (void)build_tile(description);
    FAIL() << "was not refused";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
  }
}

TEST(BuildTile, BuildsOddWeaves) {
  for (const char* rows : {R"(rows: "X")", R"(rows: ".")", R"(rows: "XXX" rows: "...")",
                           R"(rows: "X.")", R"(rows: "X" rows: ".")"}) {
    const Tile tile = build_tile(
        describe(weave(rows) + R"(yarns { name: "y" material: "m" plies: 1 fibres_per_ply: 1
                         yarn_radius_mm: 0.1 fibre_radius_mm: 0.1 })"));
    EXPECT_EQ(tile.strands.size(), tile.threads.size()) << rows;
  }
}

TEST(EstimateTile, ComesCloseToTheTileThatIsBuilt) {
  v1::FabricDescription description =
      describe(weave(R"(rows: "X...." rows: "..X.." rows: "....X" rows: ".X..." rows: "...X.")") +
               R"(yarns { name: "y" material: "m" plies: 2 fibres_per_ply: 20 yarn_radius_mm: 0.1
         fibre_radius_mm: 0.008 hairs { per_mm: 6 length_mm: 0.3 length_sd_mm: 0.05
         reach_mm: 0.1 reach_sd_mm: 0.02 sweep_deg: 20 sweep_sd_deg: 5 } })");
  const TileEstimate estimate = estimate_tile(description);
  const Tile tile = build_tile(description);
  EXPECT_EQ(estimate.ends, 5U);
  EXPECT_EQ(estimate.picks, 5U);
  const auto fibres = static_cast<double>(tile.strands.size());
  const auto segments = static_cast<double>(tile.segment_count());
  EXPECT_NEAR(static_cast<double>(estimate.fibres), fibres, 0.03 * fibres);
  EXPECT_NEAR(static_cast<double>(estimate.segments), segments, 0.05 * segments);
}

TEST(BuildTile, LaysHairsWithOpenEndsThatStandOut) {
  v1::FabricDescription description =
      describe(weave(R"(rows: "X." rows: ".X")", 20) +
               R"(yarns { name: "y" material: "m" plies: 1 fibres_per_ply: 5 yarn_radius_mm: 0.1
         fibre_radius_mm: 0.008 hairs { per_mm: 20 length_mm: 0.3 reach_mm: 0.5 } })");
  const Tile tile = build_tile(description);
  std::size_t hairs = 0;
  for (const Strand& strand : tile.strands) {
    hairs += strand.period_x == 0 && strand.period_y == 0 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(hairs), 4 * 20 * 1.03, 8);
  EXPECT_GT(tile.z_max_mm, 0.5F);
  EXPECT_LT(tile.z_min_mm, -0.5F);
}

TEST(WholeTurns, RoundToTheNearestWholeTurn) {
  v1::Yarn yarn;
  yarn.set_ply_twist_per_cm(4);
  yarn.set_fibre_twist_per_cm(-7);
  yarn.mutable_migration()->set_rate(1.4);
  const Turns turns = whole_turns(yarn, 8);
  EXPECT_EQ(turns.ply, 3);
  EXPECT_EQ(turns.fibre, -6);
  EXPECT_EQ(turns.migration, 8);
}

}  // namespace
}  // namespace weft::fabric
