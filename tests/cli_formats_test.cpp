#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/textile_facts.h"
#include "render/image.h"
#include "render/obj_mesh.h"
#include "tests/cli_one_material.h"

// Files that weft writes, opened by software that is not ours.

namespace weft::cli {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;

// Output of a program, which must succeed.
std::string output_of(const TestFolder& folder, std::vector<std::string> command) {
  const std::string log = folder / "program.err";
  command.insert(command.begin(), "/usr/bin/env");
  ChildProcess process(std::move(command), log, true);
  std::string out;
  while (const auto line = process.read_line(120)) {
    out += *line + "\n";
  }
  EXPECT_EQ(process.wait(60).value_or(-1), 0) << core::read_file(log) << out;
  return out;
}

bool has(const std::string& command) {
  return std::system((command + " >/dev/null 2>&1").c_str()) == 0;  // NOLINT
}

// A fabric's database and maps, made once for all tests: examples/tiny.textproto of one material.
class WrittenFiles : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TestFolder>();
    run({"run", write_one_material(*folder_, "512"), "-o", at("tiny.h5"), "--quality", "preview"});
    setenv("SOURCE_DATE_EPOCH", "1700000000", 1);  // NOLINT(concurrency-mt-unsafe)
    run({"maps", at("tiny.h5"), "-o", at("maps"), "--size", "24", "--samples", "9"});
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string at(const std::string& name) { return *folder_ / name; }
  static const TestFolder& folder() { return *folder_; }
  // Writes the fibres, and returns how many there are.
  static json exported(const std::string& name) {
    return json::parse(
        run({"export", at("fabric.textproto"), "-o", at(name), "--quality", "preview", "--json"}));
  }
  static std::string run(const std::vector<std::string>& arguments) {
    const Finished finished = run_weft(*folder_, arguments);
    EXPECT_EQ(finished.code, 0) << finished.err;
    return finished.out;
  }

 private:
  static std::unique_ptr<TestFolder> folder_;
};
std::unique_ptr<TestFolder> WrittenFiles::folder_;

TEST_F(WrittenFiles, BlenderOpensFibresAndTheMaterialAndItsOwnMeshIsRead) {
  if (!has("blender --version")) {
    GTEST_SKIP() << "there is no blender";
  }
  const json counts = exported("fibres.obj");
  output_of(folder(), {"blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python",
                       WEFT_SOURCE_DIR "/tests/open_elsewhere.py", "--", at("found.json"),
                       at("grid.glb"), at("fibres.obj"), at("maps/tiny.gltf")});
  const json found = json::parse(core::read_file(at("found.json")));
  const json& fibres = found["fibres.obj"];
  const auto curves = counts["curves"].get<std::uint64_t>();
  const auto segments = counts["segments"].get<std::uint64_t>();
  EXPECT_EQ(fibres["points"], segments + curves);
  EXPECT_EQ(fibres["edges"], segments);
  const json& material = found["tiny.gltf"];
  EXPECT_EQ(material["faces"], 2);
  // 3.4 knows no anisotropy.
  EXPECT_THAT(material["images"].get<std::vector<std::string>>(),
              IsSupersetOf({"base_color.png", "normal.png", "roughness.png"}));
  EXPECT_TRUE(material["has_data"]);
  EXPECT_THAT(material["nodes"].get<std::vector<std::string>>(),
              IsSupersetOf({"NORMAL_MAP", "BSDF_VELVET"}));  // velvet: the sheen
  // A swatch of whole tiles, about 100 mm a side, in metres.
  const double repeats = material["uv"][0][1].get<double>() - material["uv"][0][0].get<double>();
  EXPECT_NEAR(repeats, std::round(repeats), 1e-4);
  EXPECT_NEAR(material["size"][0].get<double>(), 0.1, 0.01);

  // Metres, y up; the node scales.
  const render::ObjMesh grid = render::read_mesh_text(core::read_file(at("grid.glb")), "grid.glb");
  EXPECT_EQ(grid.points.size(), 20U);
  ASSERT_EQ(grid.triangles.size(), 24U);
  for (const glm::dvec3& point : grid.points) {
    EXPECT_NEAR(point.y, 0.5, 1e-6);
    EXPECT_LE(std::fabs(point.x), 0.1 + 1e-6);
    EXPECT_LE(std::fabs(point.z), 0.05 + 1e-6);
  }
  for (const render::ObjMesh::Triangle& triangle : grid.triangles) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      // Blender's texture runs with x and against glTF's z.
      const glm::dvec3& point = grid.points[triangle.points[corner]];
      EXPECT_NEAR(triangle.texture[corner].x, point.x / 0.2 + 0.5, 1e-5);
      EXPECT_NEAR(triangle.texture[corner].y, 0.5 - point.z / 0.1, 1e-5);
    }
  }
}

TEST_F(WrittenFiles, TheU3mFileKeepsItsSchemaAndUsdaItsCounts) {
  if (!has("/usr/bin/python3 -c 'import jsonschema'")) {
    GTEST_SKIP() << "/usr/bin/python3 has no jsonschema";
  }
  const json counts = exported("fibres.usda");
  const json found = json::parse(
      output_of(folder(), {"/usr/bin/python3", WEFT_SOURCE_DIR "/tests/check_formats.py",
                           at("maps/tiny.u3m"), at("fibres.usda")}));
  EXPECT_THAT(found["u3m"]["images"].get<std::vector<std::string>>(),
              ElementsAre("alpha.png", "anisotropy_rotation.png", "anisotropy_strength.png",
                          "base_color.png", "height.png", "normal.png", "roughness.png",
                          "transmission.png"));
  const json& physics = found["u3m"]["physics"];
  EXPECT_EQ(physics["material_type"]["type"], "Woven");
  EXPECT_GT(physics["thickness"].get<double>(), 0);
  EXPECT_TRUE(physics["weight"].is_null());
  EXPECT_EQ(found["usda"]["curves"], counts["curves"]);
  EXPECT_EQ(found["usda"]["points"].get<std::uint64_t>(),
            counts["segments"].get<std::uint64_t>() + counts["curves"].get<std::uint64_t>());
}

TEST_F(WrittenFiles, OpenExrsAndOpenImageIosToolsReadPictures) {
  if (!has("which exrheader oiiotool")) {
    GTEST_SKIP() << "there is no exrheader or no oiiotool";
  }
  run({"render", at("tiny.h5"), "-o", at("tiny.exr"), "--png", at("tiny.png"), "--size", "24x16",
       "--spp", "1", "--device", "cpu"});
  const std::string header = output_of(folder(), {"exrheader", at("tiny.exr")});
  EXPECT_THAT(header, HasSubstr("dataWindow (type box2i): (0 0) - (23 15)"));
  EXPECT_THAT(header, HasSubstr("R, 16-bit floating-point"));
  const std::string stats = output_of(folder(), {"oiiotool", "--stats", at("tiny.exr")});
  EXPECT_THAT(stats, HasSubstr("24 x   16"));
  EXPECT_THAT(stats, HasSubstr("NanCount: 0 0 0"));
  const json about = json::parse(core::read_file(at("maps/maps.json")));
  EXPECT_EQ(about["pictures"].size(), 9U);
  std::vector<std::string> command = {"oiiotool", "--info", "-v", at("tiny.png")};
  for (const auto& [name, meaning] : about["pictures"].items()) {
    command.push_back(at("maps/" + name));
  }
  const std::string all = output_of(folder(), command);
  EXPECT_THAT(all, HasSubstr("24 x   16, 3 channel, uint8 png"));
  for (const auto& [name, meaning] : about["pictures"].items()) {
    const std::size_t begin = all.find("Reading " + at("maps/" + name));
    ASSERT_NE(begin, std::string::npos) << name;
    const std::string said = all.substr(begin, all.find("Reading ", begin + 1) - begin);
    const bool is_fine = name == "height.png" || name == "anisotropy_rotation.png";
    EXPECT_THAT(said,
                HasSubstr(std::string("24 x   24, ") + (name == "base_color.png" ? "4" : "3") +
                          " channel, " + (is_fine ? "uint16" : "uint8") + " png"))
        << name;
    EXPECT_THAT(said, HasSubstr("tiny: " + meaning["meaning"].get<std::string>()));
    // Pixels per inch: 24 on the tile's width.
    const std::size_t density = said.find("XResolution: ");
    ASSERT_NE(density, std::string::npos) << name;
    EXPECT_NEAR(std::stod(said.substr(density + 13)), 24 * 25.4 / about["size_mm"][0].get<double>(),
                0.1)
        << name;
  }
}

TEST_F(WrittenFiles, MapsAreTheSameTwiceAndWrongUseIsSaid) {
  const auto bytes = [](const std::string& folder) {
    std::string all;
    for (const char* name : {"base_color.png", "height.png", "transmission.png", "tiny.u3m",
                             "tiny.gltf", "tiny.bin"}) {
      all += core::read_file(at(folder + "/" + name));
    }
    return all;
  };
  run({"maps", at("tiny.h5"), "-o", at("again"), "--size", "24", "--samples", "9", "--threads",
       "3"});
  EXPECT_EQ(bytes("maps"), bytes("again"));

  const Finished file = run_weft(folder(), {"maps", at("tiny.h5"), "-o", at("tiny.h5")});
  EXPECT_EQ(file.code, 1);
  EXPECT_THAT(file.err, HasSubstr("is no folder and cannot be made one; choose another -o"));
  EXPECT_EQ(run_weft(folder(), {"maps", at("absent.h5"), "-o", at("m")}).code, 3);
  EXPECT_EQ(run_weft(folder(), {"maps", at("tiny.h5"), "-o", at("m"), "--size", "3"}).code, 2);
  const Finished fibres = run_weft(folder(), {"maps", at("fabric.textproto"), "-o", at("m")});
  EXPECT_EQ(fibres.code, 1);
  EXPECT_THAT(fibres.err, HasSubstr("make a database of it with weft run"));
}

TEST_F(WrittenFiles, MapsHaveTheColourThatTheClothHasUnderAWhiteSky) {
  const json about = json::parse(core::read_file(at("maps/maps.json")));
  core::write_file_atomically(
      at("sky.textproto"),
      "cut_lights_at_horizon: true\n"
      "camera { position { z: 10 } look_at { z: 0 } orthographic { height_mm: " +
          std::to_string(about["size_mm"][1].get<double>()) +
          " } }\n"
          "lights { environment { radiance { r: 1 g: 1 b: 1 } } }\n"
          "cloths { flat { endless: true } }\n"
          "picture { width: 48 height: 48 samples_per_pixel: 32 }\n");
  run({"render", at("tiny.h5"), "--scene", at("sky.textproto"), "-o", at("sky.exr"), "--device",
       "cpu", "--float"});
  const render::Image image = render::read_exr(at("sky.exr"));
  const double coverage = about["mean"]["coverage"];
  for (int c = 0; c < 3; ++c) {
    double mean = 0;
    for (const glm::vec3& pixel : image.pixels) {
      mean += static_cast<double>(pixel[c]) / static_cast<double>(image.pixels.size());
    }
    const double baked = about["mean"]["base_colour"][static_cast<std::size_t>(c)].get<double>() +
                         about["reflection_f0"][static_cast<std::size_t>(c)].get<double>();
    EXPECT_NEAR(coverage * baked / mean, 1, 0.04) << "channel " << c;
  }
}

fabric::Draft draft(const std::vector<std::string>& rows) {
  fabric::Draft result;
  result.ends = static_cast<std::uint32_t>(rows[0].size());
  result.picks = static_cast<std::uint32_t>(rows.size());
  for (const std::string& row : rows) {
    for (const char c : row) {
      result.up.push_back(c == 'X' ? 1 : 0);
    }
  }
  result.end_yarns.assign(result.ends, "a");
  result.pick_yarns.assign(result.picks, "b");
  result.end_yarns[0] = "other";  // colours do not change what a weave is called
  return result;
}

TEST(TextileFacts, WeavesHaveTheNamesThatTheTradeGivesThem) {
  EXPECT_EQ(weave_word(draft({"X.X.", ".X.X", "X.X.", ".X.X"})).type, "Plain weave");
  EXPECT_EQ(weave_word(draft({"XX..", ".XX.", "..XX", "X..X"})).type, "Twill - right hand (Z)");
  EXPECT_EQ(weave_word(draft({"XX..", "X..X", "..XX", ".XX."})).type, "Twill - left hand (S)");
  EXPECT_EQ(weave_word(draft({"X....", "..X..", "....X", ".X...", "...X."})).type, "Satin");
  const TradeWord basket = weave_word(draft({"XX..", "XX..", "..XX", "..XX"}));
  EXPECT_EQ(basket.type, "other");
  EXPECT_EQ(basket.name, "weave that repeats after 4 ends and 4 picks");
}

TEST(TextileFacts, FibresAreSharedByVolume) {
  fabric::Tile tile;
  tile.material_names = {"silk_red", "ginger", "raw-silk", "silky"};
  const auto add = [&](std::uint32_t material, float length, float radius) {
    const auto first = static_cast<std::uint32_t>(tile.points_mm.size());
    tile.strands.push_back({first, 2, material, 0, radius, 0, 0});
    tile.points_mm.insert(tile.points_mm.end(), {{0, 0, 0}, {length, 0, 0}});
  };
  add(0, 2, 1);
  add(2, 1, 1);
  add(1, 1, 2);
  add(3, 1, 1);
  const std::vector<Fibre> fibres = composition(tile);
  ASSERT_EQ(fibres.size(), 3U);
  EXPECT_EQ(fibres[0].word.name, "ginger");
  EXPECT_DOUBLE_EQ(fibres[0].share, 0.5);
  EXPECT_EQ(fibres[1].word.type, "Silk");
  EXPECT_DOUBLE_EQ(fibres[1].share, 3.0 / 8);
  EXPECT_EQ(fibres[2].word.name, "silky");
}

}  // namespace
}  // namespace weft::cli
