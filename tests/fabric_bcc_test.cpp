#include <cmath>
#include <cstring>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/bcc.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/export_curves.h"
#include "fabric/knit_pattern.h"

namespace weft::fabric {
namespace {

using ::testing::HasSubstr;

template <class T>
void append(std::string& bytes, T value) {
  const char* begin = reinterpret_cast<const char*>(&value);
  bytes.append(begin, sizeof(T));
}

struct Curve {
  std::vector<glm::vec3> points;
  bool closed = false;
};

std::string bcc(const std::vector<Curve>& curves, char up = 2) {
  std::string bytes = "BCC";
  bytes += {0x44, 'C', '0', 3, up};
  append<std::uint64_t>(bytes, curves.size());
  std::uint64_t points = 0;
  for (const Curve& curve : curves) {
    points += curve.points.size();
  }
  append(bytes, points);
  bytes.append(40, ' ');
  for (const Curve& curve : curves) {
    const auto count = static_cast<std::int32_t>(curve.points.size());
    append(bytes, curve.closed ? -count : count);
    for (const glm::vec3& p : curve.points) {
      append(bytes, p.x);
      append(bytes, p.y);
      append(bytes, p.z);
    }
  }
  return bytes;
}

std::string mistake(const std::string& bytes) {
  try {
    (void)read_bcc(bytes, "y.bcc");
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    return error.what();
  }
  return "nothing was wrong";
}

TEST(Bcc, CurvesComeWithTheirEndsAndAreTurnedUpright) {
  const std::vector<BccCurve> curves =
      read_bcc(bcc({{{{0, 1, 2}, {3, 4, 5}}, false}, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, true}}, 1),
               "y.bcc");
  ASSERT_EQ(curves.size(), 2U);
  EXPECT_FALSE(curves[0].closed);
  EXPECT_TRUE(curves[1].closed);
  EXPECT_EQ(curves[0].points[1], glm::dvec3(3, -5, 4));
}

TEST(Bcc, AYarnThatEndsWhereItBeginsInAnotherTileGoesOnThere) {
  CurveTiling tiling{{4, 2}, 10, 0.2};
  const std::vector<BccCurve> curves =
      read_bcc(bcc({{{{0, 0, 0}, {0.2f, 0.05f, 0.01f}, {0.4f, -0.2f, 0.002f}}, false},
                    {{{0, 0.1f, 0}, {0.2f, 0.1f, 0}, {0.3f, 0.1f, 0}}, false}}),
               "y.bcc");
  const std::vector<PeriodicCurve> made = periodic_curves(curves, tiling);
  EXPECT_TRUE(made[0].is_periodic);
  EXPECT_EQ(made[0].period, glm::ivec2(1, -1));
  EXPECT_EQ(made[0].curve.points.size(), 2U);
  EXPECT_FALSE(made[1].is_periodic);
  try {
    (void)pattern_text(curves, tiling, "y.bcc");
    ADD_FAILURE();
  } catch (const core::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("y.bcc: curve 2 ends, and not where it begins"));
  }
}

TEST(Bcc, CentreLinesBecomeAPatternThatIsReadAgain) {
  const std::vector<BccCurve> curves =
      read_bcc(bcc({{{{0, 0, 0}, {1, 0.3f, 0.5f}, {2, -0.3f, 0.5f}, {4, 0, 0}}, false},
                    {{{1, 1, 0}, {2, 1, 0}, {1.5f, 1.5f, 0.4f}}, true}}),
               "y.bcc");
  const KnitPattern pattern = parse_pyp(pattern_text(curves, CurveTiling{{4, 2}, 1, 0.2}, "y.bcc"));
  EXPECT_EQ(pattern.size, glm::dvec2(4, 2));
  EXPECT_DOUBLE_EQ(pattern.radius, 0.2);
  ASSERT_EQ(pattern.curves.size(), 2U);
  EXPECT_EQ(pattern.curves[0].period, glm::ivec2(1, 0));
  EXPECT_EQ(pattern.curves[0].vertices.size(), 3U);
  EXPECT_EQ(pattern.curves[1].period, glm::ivec2(0, 0));
}

TEST(Bcc, FibresThatWereExportedComeBack) {
  v1::FabricDescription description = parse_description(
      R"(name: "k" weave { matrix { rows: "X." rows: ".X" } ends_per_cm: 20 picks_per_cm: 20
           warp_yarn: "y" weft_yarn: "y" }
         yarns { name: "y" material: "m" fibres_per_ply: 3 yarn_radius_mm: 0.15 }
         materials { name: "m" preset: "silk" })",
      "test.textproto", ".");
  const Tile tile = build_tile(description);
  ExportOptions options;
  options.format = CurveFormat::kBcc;
  const std::vector<BccCurve> curves = read_bcc(export_curves(tile, options), "y.bcc");
  CurveTiling tiling;
  tiling.period_mm = tile.size_mm;
  tiling.radius_mm = static_cast<double>(tile.strands[0].radius_mm);
  description.clear_structure();
  description.clear_yarns();
  *description.mutable_explicit_fibres() = explicit_fibres(curves, tiling, "m");
  const Tile again = build_tile(description);
  ASSERT_EQ(again.strands.size(), tile.strands.size());
  EXPECT_EQ(again.segment_count(), tile.segment_count());
  for (std::size_t s = 0; s < tile.strands.size(); ++s) {
    EXPECT_EQ(again.strands[s].period_x, tile.strands[s].period_x);
    EXPECT_EQ(again.strands[s].period_y, tile.strands[s].period_y);
  }
  float farthest = 0;
  for (std::size_t p = 0; p < tile.points_mm.size(); ++p) {
    farthest = std::max(farthest, glm::distance(tile.points_mm[p], again.points_mm[p]));
  }
  EXPECT_LT(farthest, 1e-5f);
}

TEST(Bcc, EveryMistakeNamesItsByte) {
  const std::string whole = bcc({{{{0, 0, 0}, {1, 0, 0}}, false}});
  EXPECT_THAT(mistake("hello"), HasSubstr("y.bcc: byte 0: the file does not begin as a binary"));
  std::string changed = whole;
  changed[3] = static_cast<char>(0x88);
  EXPECT_THAT(mistake(changed), HasSubstr("not of four bytes each"));
  changed = whole;
  changed[6] = 2;
  EXPECT_THAT(mistake(changed), HasSubstr("three dimensions"));
  changed = whole;
  changed[16] = 1;  // of its two points
  EXPECT_THAT(mistake(changed), HasSubstr("curve 1 states 2 points"));
  EXPECT_THAT(mistake(bcc({{{{0, 0, 0}}, true}})), HasSubstr("curve 1 states 1 points"));
  EXPECT_THAT(mistake(bcc({{{{0, 0, 0}, {NAN, 0, 0}}, false}})),
              HasSubstr("a coordinate is not finite"));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(mistake(whole.substr(0, size)), "nothing was wrong") << size;
  }
}

}  // namespace
}  // namespace weft::fabric
