#include <cmath>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "fabric/export_curves.h"

namespace weft::fabric {
namespace {

Tile small_tile() {
  Tile tile;
  tile.size_mm = {2, 1};
  tile.z_min_mm = -1;
  tile.z_max_mm = 1;
  tile.material_names = {"red", "blue"};
  tile.yarn_names = {"w", "f"};
  tile.threads = {{0, Role::kWarp, 0}, {1, Role::kWeft, 0}};
  tile.strands = {{0, 3, 0, 0, 0.01F, 0, 1}, {3, 2, 1, 1, 0.02F, 1, 0}};
  tile.points_mm = {
      {0.1F, 0, 0.3F}, {0.2F, 0.5F, 1 / 3.0F}, {0.1F, 1, 0.3F}, {0, 0.7F, 0}, {2, 0.7F, 0}};
  index_segments(tile);
  return tile;
}

template <class T>
T take(const std::string& bytes, std::size_t& at) {
  T value{};
  EXPECT_LE(at + sizeof(T), bytes.size());
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  at += sizeof(T);
  return value;
}

TEST(ExportCurves, BccReadsBack) {
  const Tile tile = small_tile();
  const std::string bytes = export_curves(tile, {CurveFormat::kBcc, {2, 1}, {}});
  EXPECT_EQ(bytes.substr(0, 3), "BCC");
  EXPECT_EQ(bytes[3], 0x44);
  EXPECT_EQ(bytes.substr(4, 2), "C0");
  EXPECT_EQ(bytes[6], 3);
  EXPECT_EQ(bytes[7], 2);
  std::size_t at = 8;
  EXPECT_EQ(take<std::uint64_t>(bytes, at), 4U);
  EXPECT_EQ(take<std::uint64_t>(bytes, at), 10U);
  at = 64;
  for (const Strand& strand : tile.strands) {
    for (const float shift : {0.0F, 2.0F}) {
      ASSERT_EQ(take<std::int32_t>(bytes, at), static_cast<std::int32_t>(strand.point_count));
      for (std::uint32_t p = 0; p < strand.point_count; ++p) {
        EXPECT_EQ(take<glm::vec3>(bytes, at),
                  tile.points_mm[strand.first_point + p] + glm::vec3(shift, 0, 0));
      }
    }
  }
  EXPECT_EQ(at, bytes.size());
}

TEST(ExportCurves, ObjReadsBackToTheLastBit) {
  const Tile tile = small_tile();
  std::istringstream lines(export_curves(tile, {CurveFormat::kObj, {1, 1}, {}}));
  std::vector<glm::vec3> vertices;
  std::vector<std::vector<std::size_t>> polylines;
  std::string line;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      glm::vec3 v{0};
      words >> v.x >> v.y >> v.z;
      vertices.push_back(v);
    } else if (kind == "l") {
      polylines.emplace_back();
      for (std::size_t index = 0; words >> index;) {
        polylines.back().push_back(index);
      }
    } else {
      EXPECT_TRUE(kind == "g" || kind == "#") << line;
    }
  }
  EXPECT_EQ(vertices, tile.points_mm);
  const std::vector<std::vector<std::size_t>> expected = {{1, 2}, {2, 3}, {4, 5}};
  EXPECT_EQ(polylines, expected);
}

TEST(ExportCurves, PbrtControlPointsLieOnTheSegments) {
  const Tile tile = small_tile();
  const std::string text =
      export_curves(tile, {CurveFormat::kPbrt, {1, 1}, {{1, 0, 0}, {0, 0, 2}}});
  EXPECT_NE(text.find("MakeNamedMaterial \"blue\" \"string type\" \"diffuse\" \"rgb reflectance\" "
                      "[ 0 0 1 ]"),
            std::string::npos);
  EXPECT_NE(text.find("\"float width0\" 0.0199999996"), std::string::npos) << text;
  std::vector<std::vector<glm::vec3>> curves;
  for (std::size_t at = text.find("P\" ["); at != std::string::npos;
       at = text.find("P\" [", at + 1)) {
    std::istringstream numbers(text.substr(at + 4));
    curves.emplace_back();
    for (glm::vec3 p{0}; numbers >> p.x >> p.y >> p.z;) {
      curves.back().push_back(p);
    }
  }
  ASSERT_EQ(curves.size(), tile.strands.size());
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const Strand& strand = tile.strands[c];
    ASSERT_EQ(curves[c].size(), 3 * (strand.point_count - 1) + 1);
    for (std::uint32_t p = 0; p < strand.point_count; ++p) {
      EXPECT_EQ(curves[c][3 * p], tile.points_mm[strand.first_point + p]);
    }
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      const glm::vec3 a = curves[c][3 * p];
      const glm::vec3 b = curves[c][3 * p + 3];
      EXPECT_LT(glm::distance(curves[c][3 * p + 1], a + (b - a) / 3.0F), 1e-6F);
      EXPECT_LT(glm::distance(curves[c][3 * p + 2], a + (b - a) * (2 / 3.0F)), 1e-6F);
    }
  }
}

TEST(ExportCurves, RefusesNothingAndTooMuch) {
  EXPECT_THROW((void)export_curves(small_tile(), {CurveFormat::kBcc, {0, 1}, {}}), core::Error);
  EXPECT_THROW((void)export_curves(small_tile(), {CurveFormat::kBcc, {20000, 20000}, {}}),
               core::Error);
}

TEST(ExportCurves, UsdaHasAPrimForEachMaterial) {
  const std::string text =
      export_curves(small_tile(), {CurveFormat::kUsda, {2, 1}, {{0.5F, 0, 0}, {0, 0, 2}}});
  EXPECT_EQ(text.substr(0, 10), "#usda 1.0\n");
  const auto has = [&text](const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " is not in\n" << text;
  };
  has("metersPerUnit = 0.001\n    upAxis = \"Z\"");
  has("def BasisCurves \"material_0_red\"");
  has("int[] curveVertexCounts = [3, 3]");
  has("float[] widths = [0.0199999996, 0.0199999996] (");
  has("color3f[] primvars:displayColor = [(0.5, 0, 0)]");
  has("def BasisCurves \"material_1_blue\"");
  has("point3f[] points = [(0, 0.699999988, 0), (2, 0.699999988, 0), (2, 0.699999988, 0), (4, "
      "0.699999988, 0)]");
  has("(0, 0, 1)]");  // colours end at 1
}

}  // namespace
}  // namespace weft::fabric
