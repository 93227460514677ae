#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "render/png.h"
#include "render/read_pattern.h"
#include "render/scene_description.h"
#include "render/shell_cloth.h"
#include "tests/render_cloths.h"

namespace weft::render {
namespace {

std::shared_ptr<const Fabric> layers(float red, glm::uvec2 blocks = {2, 2}) {
  fabric::Tile tile = test::crossed_layers(4, 6, 0.05f, 4);
  tile.blocks = blocks;
  shading::FibreMaterial material;
  material.c_r = {red, 0.2f, 0.1f};
  material.c_tt = {0.6f, 0.5f, 0.4f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.35f;
  return std::make_shared<Fabric>(std::move(tile), std::vector{shading::FibreBcsdf(material)});
}

BlockPattern pattern(std::uint32_t width, std::uint32_t height, std::vector<std::uint32_t> fabric) {
  return {{1, 1}, width, height, std::move(fabric)};
}

struct Line {
  glm::dvec3 start;
  glm::dvec3 way;
};
Line random_line(std::uint32_t i) {
  core::Random random(11, i);
  const glm::dvec3 start(6 * random.uniform_double() - 3, 6 * random.uniform_double() - 3, 0.6);
  const glm::dvec3 way(4 * random.uniform_double() - 2, 4 * random.uniform_double() - 2, -0.7);
  return {start, way};
}

TEST(BlockPattern, IsRepeatedEndlesslyInEveryDirection) {
  const BlockPattern three = pattern(3, 2, {0, 1, 2, 3, 4, 5});
  for (int j = -5; j < 5; ++j) {
    for (int i = -7; i < 7; ++i) {
      const int x = ((i % 3) + 3) % 3;
      const int y = ((j % 2) + 2) % 2;
      EXPECT_EQ(three.at(i, j), static_cast<std::uint32_t>(3 * y + x));
    }
  }
}

TEST(ClothFabric, APatternOfOneFabricIsThatFabric) {
  const auto fabric = layers(0.3f);
  const ClothFabric plain(fabric);
  const ClothFabric patterned({fabric, fabric}, pattern(2, 1, {1, 1}));
  int hits = 0;
  for (std::uint32_t i = 0; i < 500; ++i) {
    const Line line = random_line(i);
    const auto a = plain.closest(line.start, line.way, {});
    const auto b = patterned.closest(line.start, line.way, {});
    ASSERT_EQ(a.has_value(), b.has_value());
    if (a) {
      ++hits;
      EXPECT_EQ(a->segment, b->segment);
      EXPECT_EQ(a->copy, b->copy);
      EXPECT_EQ(a->share, b->share);
      EXPECT_EQ(b->fabric, 1U);
    }
  }
  EXPECT_GT(hits, 400);
}

TEST(ClothFabric, EveryHitIsOnTheFabricOfItsBlock) {
  // Both fabrics have the same fibres, so that the cloth is the same whatever the pattern, but for
  // fibres in which a line passes a border of blocks.
  const auto fabric = layers(0.3f);
  const ClothFabric plain(fabric);
  const ClothFabric patterned({fabric, layers(0.9f)}, pattern(3, 2, {0, 1, 1, 1, 0, 0}));
  EXPECT_EQ(patterned.pattern()->block_mm, glm::dvec2(0.5, 0.5));
  int hits = 0;
  int others = 0;
  int of_second = 0;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const Line line = random_line(i);
    const auto a = plain.closest(line.start, line.way, {});
    const auto b = patterned.closest(line.start, line.way, {});
    if (!b) {
      others += a ? 1 : 0;
      continue;
    }
    ++hits;
    const glm::dvec3 at = line.start + b->share * line.way;
    const double off_x = at.x / 0.5 - std::round(at.x / 0.5);
    const double off_y = at.y / 0.5 - std::round(at.y / 0.5);
    if (std::min(std::fabs(off_x), std::fabs(off_y)) > 1e-5) {
      EXPECT_EQ(b->fabric,
                patterned.pattern()->at(static_cast<std::int64_t>(std::floor(at.x / 0.5)),
                                        static_cast<std::int64_t>(std::floor(at.y / 0.5))));
    }
    of_second += b->fabric == 1 ? 1 : 0;
    const bool same = a && a->segment == b->segment && a->copy == b->copy &&
                      std::fabs(a->share - b->share) < 1e-5;
    others += same ? 0 : 1;
  }
  EXPECT_GT(hits, 1700);
  EXPECT_GT(of_second, 500);
  EXPECT_LT(others, hits / 10);
}

TEST(ClothFabric, OnlyTheFibreOfTheSameFabricIsIgnored) {
  const ClothFabric patterned({layers(0.3f), layers(0.9f)}, pattern(2, 1, {0, 1}));
  int checked = 0;
  for (std::uint32_t i = 0; i < 200 && checked < 40; ++i) {
    const Line line = random_line(i);
    const auto met = patterned.closest(line.start, line.way, {});
    if (!met) {
      continue;
    }
    ++checked;
    const auto again = patterned.closest(line.start, line.way, FlatStart{met->copy, met->fabric});
    EXPECT_FALSE(again && again->copy == met->copy && again->fabric == met->fabric);
    const auto other =
        patterned.closest(line.start, line.way, FlatStart{met->copy, 1 - met->fabric});
    ASSERT_TRUE(other);
    EXPECT_EQ(other->share, met->share);
  }
  EXPECT_EQ(checked, 40);
}

TEST(ClothFabric, BlocksOfOtherSizesAreRefused) {
  try {
    const ClothFabric mixed({layers(0.3f), layers(0.3f, {3, 2})}, pattern(2, 1, {0, 1}));
    FAIL() << "it was taken";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    EXPECT_NE(std::string(error.what()).find("0.5 x 0.5 mm in fabric 0, 0.333333 x 0.5"),
              std::string::npos)
        << error.what();
  }
}

Drawing drawing_of(std::unique_ptr<Cloth> cloth) {
  Scene scene;
  scene.cloths.push_back(std::move(cloth));
  scene.lights.emplace_back(DirectionalLight{{0, 0, 1}, {1, 1, 1}});
  Camera::View view;
  view.position_mm = {1, 1, 10};
  view.look_at_mm = {1, 1, 0};
  view.perspective = false;
  view.height = 1;
  scene.camera = Camera(view, 1.0);
  PathSettings settings;
  settings.scattering = Scattering::kSingleOnly;
  const PathIntegrator integrator(scene, settings);
  DrawSettings draw_settings;
  draw_settings.width = draw_settings.height = 16;
  draw_settings.samples_per_pixel = 4;
  return draw(
      scene.camera, integrator, draw_settings, [](double) {}, [] { return false; });
}

TEST(ClothFabric, PixelsWithinABlockAreThoseOfItsFabric) {
  // Seen and lit from straight above, every block is on its own. The picture shows four of them.
  FlatPlacement placement;
  placement.size_mm = {2, 2};
  placement.centre_mm = {1, 1, 0};
  std::vector<std::shared_ptr<const Fabric>> fabrics{layers(0.1f), layers(0.9f)};
  const Drawing mixed =
      drawing_of(make_flat_cloth(ClothFabric(fabrics, pattern(2, 2, {0, 1, 1, 0})), placement));
  // One fabric, its origin moved to the corner as that of patterned cloth is.
  const Drawing first =
      drawing_of(make_flat_cloth(ClothFabric(fabrics, pattern(1, 1, {0})), placement));
  const Drawing second =
      drawing_of(make_flat_cloth(ClothFabric(fabrics, pattern(1, 1, {1})), placement));
  int differences = 0;
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      // The picture spans [0.5, 1.5]: blocks (1, 1) to (2, 2), its top row at the greatest y.
      const bool is_second = (x < 8) == (y < 8);
      const Drawing& expected = is_second ? second : first;
      EXPECT_EQ(mixed.image.at(x, y), expected.image.at(x, y)) << x << " " << y;
      differences += first.image.at(x, y) != second.image.at(x, y) ? 1 : 0;
    }
  }
  EXPECT_GT(differences, 150);
}

TEST(ClothFabric, AShellShowsThePatternOfTheFlatFabric) {
  std::vector<std::shared_ptr<const Fabric>> fabrics{layers(0.1f), layers(0.9f)};
  const ClothFabric patterned(fabrics, pattern(2, 2, {0, 1, 1, 1}));
  ShellPlacement placement;
  placement.texture_mm = {1, 1};
  std::vector<std::string> remarks;
  const auto shell =
      make_shell_cloth(patterned, test::sheet(6, 2, [](glm::dvec2 p) { return glm::dvec3(p, 0); }),
                       placement, remarks);
  int hits = 0;
  for (std::uint32_t i = 0; i < 400; ++i) {
    core::Random random(12, i);
    const Ray ray{{3 * random.uniform_double() - 1.5, 3 * random.uniform_double() - 1.5, 2},
                  glm::normalize(glm::dvec3(random.uniform_double() - 0.5,
                                            random.uniform_double() - 0.5, -2))};
    const Meeting met = shell->closest(ray, kInfinity, nullptr);
    if (met.fate != Fate::kFibre) {
      continue;
    }
    ++hits;
    const glm::dvec3 at = met.hit.flat_mm;
    EXPECT_EQ(met.hit.fabric,
              patterned.pattern()->at(static_cast<std::int64_t>(std::floor(at.x / 0.5)),
                                      static_cast<std::int64_t>(std::floor(at.y / 0.5))));
    EXPECT_EQ(&shell->fabric(met.hit), fabrics[met.hit.fabric].get());
  }
  EXPECT_GT(hits, 300);
}

v1::Pattern rows_of(const std::vector<std::string>& rows, int fabrics) {
  v1::Pattern result;
  for (int k = 0; k < fabrics; ++k) {
    result.add_fabrics(fmt::format("f{}", k));
  }
  for (const std::string& row : rows) {
    result.mutable_rows()->add_row(row);
  }
  return result;
}

TEST(ReadPattern, TheLastRowIsTheLowest) {
  const BlockPattern read = pattern_of(rows_of({"01", "2b"}, 12));
  EXPECT_EQ(read.width, 2U);
  EXPECT_EQ(read.height, 2U);
  EXPECT_EQ(read.fabric, (std::vector<std::uint32_t>{2, 11, 0, 1}));
}

// 3 x 2 pixels. Grey: levels 200 7 7 over 7 7 200. Palette: 0 1 2 over 2 1 0.
const std::string kGrey(
    "\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x03\x00\x00\x00"
    "\x02\x08\x00\x00\x00\x00\xb8\x1f\x39\xc6\x00\x00\x00\x10\x49\x44\x41\x54\x78\x9c\x63\x38\xc1"
    "\xce\xce\xc0\xce\x7e\x02\x00\x06\xb8\x01\xad\x63\x14\xbb\xdf\x00\x00\x00\x00\x49\x45\x4e\x44"
    "\xae\x42\x60\x82",
    73);
const std::string kPalette(
    "\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x03\x00\x00\x00"
    "\x02\x02\x03\x00\x00\x00\xe0\x1a\x8e\x89\x00\x00\x00\x09\x50\x4c\x54\x45\xff\x00\x00\x00\xff"
    "\x00\x00\x00\xff\x2d\x4a\xcd\x8a\x00\x00\x00\x0c\x49\x44\x41\x54\x78\x9c\x63\x90\x60\x98\x00"
    "\x00\x00\xdc\x00\xa9\x6c\xe7\xc0\x23\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82",
    90);

BlockPattern pattern_in(const std::string& picture, int fabrics) {
  v1::Pattern description = rows_of({}, fabrics);
  description.set_png_file("p.png");
  return pattern_of(description, [&](const std::string&) { return picture; });
}

TEST(ReadPattern, PicturesAreReadByPaletteOrByGreyLevel) {
  EXPECT_EQ(pattern_in(kGrey, 2).fabric, (std::vector<std::uint32_t>{0, 0, 1, 1, 0, 0}));
  EXPECT_EQ(pattern_in(kPalette, 3).fabric, (std::vector<std::uint32_t>{2, 1, 0, 0, 1, 2}));
}

TEST(ReadPattern, PicturesThatNameNoFabricsAreRefused) {
  const auto code_of = [](const std::string& picture, int fabrics) -> std::optional<core::Code> {
    try {
      static_cast<void>(pattern_in(picture, fabrics));
    } catch (const core::Error& error) {
      return error.code();
    }
    return std::nullopt;
  };
  EXPECT_EQ(code_of(kGrey, 3), core::Code::kInvalidArgument);     // two levels for three fabrics
  EXPECT_EQ(code_of(kPalette, 2), core::Code::kInvalidArgument);  // names a third
  EXPECT_EQ(code_of("", 2), core::Code::kDataLoss);
  EXPECT_EQ(code_of("no picture at all", 2), core::Code::kDataLoss);
  for (std::size_t length = 8; length < kGrey.size() - 12; length += 3) {
    EXPECT_EQ(code_of(kGrey.substr(0, length), 2), core::Code::kDataLoss) << length;
  }
  const auto path = std::filesystem::path(testing::TempDir()) / "colours.png";
  const std::vector<std::uint8_t> colours(12, 100);
  write_png(path, 2, 2, colours);
  v1::Pattern description = rows_of({}, 1);
  description.set_png_file(path.string());
  EXPECT_THROW(static_cast<void>(pattern_of(description)), core::Error);
}

TEST(ReadPattern, MistakesInASceneAreReportedAtTheirPlace) {
  const auto complaint = [](const std::string& text) {
    try {
      static_cast<void>(parse_scene(text, "s.textproto", "."));
    } catch (const core::Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string flat = " flat { } }";
  EXPECT_EQ(complaint("cloths { pattern { fabrics: \"a\" rows { row: \"0\" } }" + flat), "");
  for (const auto& [pattern_text, part] : std::vector<std::pair<std::string, std::string>>{
           {"pattern { rows { row: \"0\" } }", "give from 1 to 36 fabrics"},
           {"pattern { fabrics: \"a\" }", "no matrix"},
           {"pattern { fabrics: \"a\" rows { } }", "the matrix is empty"},
           {"pattern { fabrics: \"a\" rows { row: \"01\" } }", "fabric 1, but there are only 1"},
           {"pattern { fabrics: \"a\" rows { row: \"00\" row: \"0\" } }", "equal length"},
           {"pattern { fabrics: \"a\" rows { row: \"-\" } }", "written '-'"},
           {"fabric: \"b\" pattern { fabrics: \"a\" rows { row: \"0\" } }", "beside a pattern"}}) {
    const std::string message = complaint(fmt::format("cloths {{ {}{}", pattern_text, flat));
    EXPECT_NE(message.find(part), std::string::npos) << pattern_text << message;
    EXPECT_NE(message.find("cloths[0]."), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace weft::render
