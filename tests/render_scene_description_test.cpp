#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/obj_mesh.h"
#include "render/scene_description.h"

namespace weft::render {
namespace {

std::string complaint(const std::string& text, const std::string& name = "s.textproto") {
  try {
    static_cast<void>(parse_scene(text, name, "/scenes"));
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kInvalidArgument);
    return error.what();
  }
  return {};
}

bool says(const std::string& message, const std::string& part) {
  return message.find(part) != std::string::npos;
}

TEST(SceneDescription, TextAndJsonGiveTheSameScene) {
  const v1::Scene text = parse_scene(
      "lights { sg { towards { z: 1 } sharpness: 20 } }\n"
      "cloths { shell { obj_file: \"towel.obj\" } }\n",
      "s.textproto", "/scenes");
  const v1::Scene json = parse_scene(
      R"({"lights": [{"sg": {"towards": {"z": 1}, "sharpness": 20}}],
          "cloths": [{"shell": {"objFile": "towel.obj"}}]})",
      "s.json", "/scenes");
  EXPECT_EQ(text.SerializeAsString(), json.SerializeAsString());
  EXPECT_EQ(text.cloths(0).shell().obj_file(), "/scenes/towel.obj");
}

TEST(SceneDescription, MistakesAreReportedAtTheirPlaceAllAtOnce) {
  const std::string message = complaint(
      "lights { sg { sharpness: -3 } }\n"
      "cloths {\n"
      "  flat { size_x_mm: 2 tiles_x: 3 }\n"
      "}\n");
  EXPECT_TRUE(says(message, "s.textproto:1:15: lights[0].sg.sharpness: out of range")) << message;
  EXPECT_TRUE(says(message, "s.textproto:1:10: lights[0].sg.towards: no direction")) << message;
  EXPECT_TRUE(says(message, "s.textproto:3:23: cloths[0].flat.tiles_x: the size is given twice"))
      << message;
}

TEST(SceneDescription, JsonMistakesNameTheField) {
  EXPECT_TRUE(says(complaint(R"({"lights": [{"sg": {"sharpness": -3}}]})", "s.json"),
                   "s.json: lights[0].sg.sharpness: out of range"));
  EXPECT_TRUE(says(complaint(R"({"camera": {"zoom": 3}})", "s.json"), "zoom"));
}

TEST(SceneDescription, UnknownFieldsSayWhichThereAre) {
  const std::string message = complaint("camera { zoom: 3 }");
  EXPECT_TRUE(says(message, "s.textproto:1:10:")) << message;
  EXPECT_TRUE(says(message, "look_at")) << message;
}

TEST(SceneDescription, WhatCannotBeDrawnIsRefused) {
  for (const char* text : {
           "camera { position { z: 3 } }",
           "camera { position { z: 3 } look_at { z: 3 } }",
           "camera { position { z: 3 } look_at { z: 0 } up { z: 1 } }",
           "camera { perspective { vertical_angle_deg: 180 } }",
           "lights { }",
           "lights { directional { } }",
           "lights { directional { towards { x: nan } } }",
           "lights { point { position { z: 1 } } }",
           "lights { area { } }",
           "lights { area { rectangle { corner { } edge_a { x: 1 } edge_b { x: 2 } } } }",
           "lights { area { disc { normal { z: 1 } } } }",
           "lights { environment { radiance { r: -1 } } }",
           "cloths { }",
           "cloths { shell { } }",
           "cloths { flat { size_x_mm: 1e9 } }",
           "cloths { flat { size_x_mm: inf } }",
           "picture { width: 100000 }",
           "picture { samples_per_pixel: 4000000000 }",
           "nonsense",
       }) {
    EXPECT_NE(complaint(text), "") << text;
  }
}

TEST(SceneDescription, TheDefaultSceneIsComplete) {
  v1::Scene scene = default_scene();
  expand_picture_defaults(scene);
  EXPECT_GE(scene.lights_size(), 2);
  EXPECT_EQ(scene.cloths_size(), 1);
  EXPECT_GT(scene.picture().samples_per_pixel(), 0U);
  EXPECT_EQ(scene.integration().integrator(), v1::INTEGRATOR_PRECOMPUTED);
}

TEST(SceneDescription, TheExamplesAreScenes) {
  const std::filesystem::path folder = std::filesystem::path(WEFT_SOURCE_DIR) / "examples/scenes";
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".textproto") {
      continue;
    }
    ++scenes;
    const v1::Scene scene = load_scene(entry.path());
    EXPECT_GT(scene.lights_size(), 0);
    for (const v1::Cloth& cloth : scene.cloths()) {
      if (cloth.has_shell()) {
        EXPECT_FALSE(read_obj(cloth.shell().obj_file()).triangles.empty());
      }
    }
  }
  EXPECT_GE(scenes, 2);
  // The default scene, written out.
  const v1::Scene swatch = load_scene(folder / "swatch.textproto");
  EXPECT_EQ(swatch.SerializeAsString(), default_scene().SerializeAsString());
}

}  // namespace
}  // namespace weft::render
