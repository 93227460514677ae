#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/fibres.h"
#include "fabric/knit_pattern.h"
#include "fabric/relax.h"

namespace weft::fabric {
namespace {

// Two yarns: one along x in three vertices, one along (1, 1) in four.
constexpr const char* kSmall = R"(*pattern # px py radius num_vertedges
4 4 0.2 7

*Q # dofs: x y z t
0 0 0 0
1.3 0 0.5 0
2.6 0 0 0
0 2 3 0
1 3 3.2 0
2 4 3 0
3 1 3.2 0
*E # edges [v0, v1, dx, dy]
2 0 1 0
0 1 0 0
1 2 0 0
3 4 0 0
4 5 0 0
5 6 0 1
6 3 1 0
*RL # rest lengths
1
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

v1::FabricDescription describe(const std::string& pattern, double scale) {
  v1::FabricDescription description = parse_description(
      R"(name: "k" weave { matrix { rows: "X" } ends_per_cm: 10 picks_per_cm: 10
           warp_yarn: "y" weft_yarn: "y" }
         yarns { name: "y" material: "m" plies: 2 fibres_per_ply: 5 yarn_radius_mm: 0.2 }
         materials { name: "m" c_r { r: 0.2 g: 0.2 b: 0.2 } c_tt { r: 0.5 g: 0.5 b: 0.5 }
           beta_r_deg: 10 beta_tt_deg: 20 gamma_tt_deg: 30 })",
      "test.textproto", ".");
  v1::YarnCurves& curves = *description.mutable_yarn_curves();
  curves.set_pyp_text(pattern);
  curves.set_scale(scale);
  curves.set_yarn("y");
  return description;
}

TEST(KnitPattern, FollowsEdgesAcrossTheTilesBorders) {
  const KnitPattern pattern = parse_pyp(kSmall);
  EXPECT_EQ(pattern.size, glm::dvec2(4, 4));
  ASSERT_EQ(pattern.curves.size(), 2U);
  EXPECT_EQ(pattern.curves[0].vertices.size(), 3U);
  EXPECT_EQ(pattern.curves[0].period, glm::ivec2(1, 0));
  EXPECT_EQ(pattern.curves[1].vertices.size(), 4U);
  EXPECT_EQ(pattern.curves[1].period, glm::ivec2(1, 1));
  // The vertex after the border is unwrapped.
  EXPECT_EQ(pattern.curves[1].vertices[3], glm::dvec3(3, 5, 3.2));
}

TEST(KnitPattern, BecomesStrandsWithThePeriodsOfItsEdges) {
  v1::FabricDescription description = describe(kSmall, 1);
  description.mutable_exemplar()->set_repeats_x(2);
  const Tile tile = build_tile(description);
  // The straight yarn is copied once per row; two copies of it join across, as do the slanted ones.
  ASSERT_EQ(tile.threads.size(), 2U);
  EXPECT_EQ(tile.strands.size(), 2U * 10U);
  for (const Strand& strand : tile.strands) {
    EXPECT_EQ(strand.period_x, 1);
    EXPECT_EQ(strand.period_y, strand.thread == 0 ? 0 : 2);
    const glm::vec3 first = tile.points_mm[strand.first_point];
    const glm::vec3 last = tile.points_mm[strand.first_point + strand.point_count - 1];
    EXPECT_EQ(last, period_end(first, {strand.period_x, strand.period_y}, tile.size_mm));
  }
}

TEST(KnitPattern, KeepsEveryFibreInsideItsYarn) {
  const Tile tile = build_tile(describe(kSmall, 1));
  float widest = 0;
  for (const Strand& strand : tile.strands) {
    if (strand.thread != 0) {
      continue;
    }
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      widest = std::max(widest, std::abs(tile.points_mm[strand.first_point + p].y));
    }
  }
  EXPECT_LE(widest, 0.2F + 1e-5F);
  EXPECT_GT(widest, 0.1F);
}

TEST(KnitPattern, RefusesBrokenFilesWithTheLine) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      (void)parse_pyp(text);
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
      return error.what();
    }
    return "was not refused";
  };
  const auto expect = [&](const std::string& text, const std::string& part) {
    const std::string what = message(text);
    EXPECT_NE(what.find(part), std::string::npos) << what;
  };
  expect("", "line 1");
  expect("hello", "line 1");
  expect("*Q\n1 2 3 4\n", "line 1");
  expect(replaced(kSmall, "4 4 0.2 7", "4 -4 0.2 7"), "line 2: size and radius");
  expect(replaced(kSmall, "4 4 0.2 7", "4 4 0.2 7e9"), "line 2");
  expect(replaced(kSmall, "4 4 0.2 7", "4 4 0.2 8"), "line 12: '*Q' has 7");
  expect(replaced(kSmall, "1.3 0 0.5 0", "1.3 zero 0.5 0"), "line 6");
  expect(replaced(kSmall, "1.3 0 0.5 0", "1.3 nan 0.5 0"), "line 6");
  expect(replaced(kSmall, "1.3 0 0.5 0", "1.3 0 0.5"), "line 6: has 3 numbers");
  expect(replaced(kSmall, "1 2 0 0", "1 7 0 0"), "line 15: an edge names a vertex");
  expect(replaced(kSmall, "1 2 0 0", "1 -2 0 0"), "line 15");
  expect(replaced(kSmall, "1 2 0 0", "1 2 0.5 0"), "line 15");
  expect(replaced(kSmall, "1 2 0 0", "0 2 0 0"), "line 15: vertex 0 already goes on");
  expect(replaced(kSmall, "1 2 0 0", "1 0 0 0"), "line 15: vertex 0 is already reached");
  expect(replaced(kSmall, "1 2 0 0\n", ""), "7 vertices and as many edges");
  expect(replaced(kSmall, "1.3 0 0.5 0", "0 0 0 0"), "stands still");
}

TEST(KnitPattern, RealPatternsBuild) {
  const char* folder = std::getenv("WEFT_SHARED_DATA");
  const std::filesystem::path curves = std::filesystem::path(folder ? folder : "") / "curves";
  if (folder == nullptr || !std::filesystem::exists(curves)) {
    GTEST_SKIP() << "WEFT_SHARED_DATA does not name a folder with curves/";
  }
  for (const auto& [name, threads] :
       {std::pair("basket_9.pyp", 8U), std::pair("satin_9.pyp", 10U)}) {
    v1::FabricDescription description = describe(core::read_file(curves / name), 120);
    description.mutable_yarn_curves()->set_pin_radius(true);
    const Tile tile = build_tile(description);
    EXPECT_EQ(tile.threads.size(), threads) << name;
    const TileEstimate estimate = estimate_tile(description);
    const auto segments = static_cast<double>(tile.segment_count());
    EXPECT_NEAR(static_cast<double>(estimate.segments), segments, 0.03 * segments) << name;
  }
}

}  // namespace
}  // namespace weft::fabric
