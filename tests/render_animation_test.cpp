#include <cmath>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/animation.h"
#include "render/scene_check.h"
#include "render/scene_description.h"

namespace weft::render {
namespace {

v1::Scene animated(const std::string& further = "") {
  return parse_scene(
      R"(lights { sg { towards { x: 1 } sharpness: 10 } }
         cloths { shell { obj_file: "cloth_%03d.obj" } }
         cloths { flat {} }
         animation {
           first_frame: 10 frames: 5
           camera { frame: 10 camera { position { z: 4 } look_at { y: 1 } } }
           camera { frame: 14 camera { position { x: 8 z: 4 } look_at { y: 1 } } }
           lights { frame: 11 value { sg { towards { x: 1 } sharpness: 10 } } }
           lights { frame: 13 value { sg { towards { z: 1 } sharpness: 1000 } } }
         )" +
          further + "}",
      "animated", "");
}

TEST(Animation, KeysAreMetAndHeldBeforeTheFirstAndAfterTheLast) {
  const v1::Scene scene = animated();
  EXPECT_EQ(frame_numbers(scene), (std::vector<std::uint32_t>{10, 11, 12, 13, 14}));
  EXPECT_EQ(scene_at_frame(scene, 10).camera().position().x(), 0);
  EXPECT_EQ(scene_at_frame(scene, 14).camera().position().x(), 8);
  for (const std::uint32_t frame : {10u, 11u}) {
    EXPECT_EQ(scene_at_frame(scene, frame).lights(0).sg().towards().x(), 1);
    EXPECT_EQ(scene_at_frame(scene, frame).lights(0).sg().sharpness(), 10);
  }
  EXPECT_EQ(scene_at_frame(scene, 14).lights(0).sg().sharpness(), 1000);
}

TEST(Animation, PositionsMoveEvenlyDirectionsTurnAndSharpnessGrowsByFactors) {
  const v1::Scene middle = scene_at_frame(animated(), 12);
  EXPECT_NEAR(middle.camera().position().x(), 4, 1e-12);
  EXPECT_EQ(middle.camera().position().z(), 4);
  EXPECT_EQ(middle.camera().look_at().y(), 1);
  const v1::SgLight& sg = middle.lights(0).sg();
  EXPECT_NEAR(sg.towards().x(), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(sg.towards().z(), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(sg.sharpness(), 100, 1e-9);
  EXPECT_FALSE(middle.has_animation());
  EXPECT_TRUE(check_scene(middle).empty());
}

TEST(Animation, EasesAndHoldsWhereThatIsSaid) {
  EXPECT_NEAR(
      scene_at_frame(animated("interpolation: INTERPOLATION_EASE"), 11).camera().position().x(),
      8 * (3.0 / 16 - 2.0 / 64), 1e-12);
  const v1::Scene held = animated("interpolation: INTERPOLATION_HOLD");
  EXPECT_EQ(scene_at_frame(held, 13).camera().position().x(), 0);
  EXPECT_EQ(scene_at_frame(held, 14).camera().position().x(), 8);
}

TEST(Animation, FilesHaveThePlaceOfTheFramesNumber) {
  EXPECT_EQ(with_frame_number("a_%04d.exr", 7), "a_0007.exr");
  EXPECT_EQ(with_frame_number("a_%d.exr", 12), "a_12.exr");
  EXPECT_EQ(with_frame_number("a_%02d.exr", 123), "a_123.exr");
  for (const char* none : {"a.exr", "a%.exr", "a%s.exr", "%d%d", "%4d", "%0d", "%04"}) {
    EXPECT_FALSE(names_frames(none)) << none;
    EXPECT_EQ(with_frame_number(none, 1), none);
  }
  EXPECT_EQ(scene_at_frame(animated(), 12).cloths(0).shell().obj_file(), "cloth_012.obj");
  EXPECT_EQ(files_of(animated()),
            (std::vector<std::string>{"cloth_010.obj", "cloth_011.obj", "cloth_012.obj",
                                      "cloth_013.obj", "cloth_014.obj"}));
}

TEST(Animation, MistakesAreNamedAtTheirPlaces) {
  const auto message_of = [](const std::string& further) -> std::string {
    try {
      static_cast<void>(animated(further));
    } catch (const core::Error& error) {
      return error.what();
    }
    return "";
  };
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"lights { frame: 14 light: 3 value { sg { towards { x: 1 } } } }", "1 lights"},
      {"lights { frame: 14 value { directional { towards { x: 1 } } } }", "another kind"},
      {"lights { frame: 14 value { sg { towards { x: 1 } } } }", "sg.sharpness"},
      {"lights { frame: 12 value { sg { towards { x: 1 } sharpness: 3 } } }", "not above"},
      {"lights { frame: 14 value { sg { towards {} sharpness: 3 } } }", "no direction"},
      {"camera { frame: 20 camera { position { x: 1 } } }", "look_at"},
      {"camera { frame: 20 camera { position { z: 4 } look_at { y: 1 } up { x: 1 } } }", "up"}};
  for (const auto& [further, part] : mistakes) {
    EXPECT_NE(message_of(further).find(part), std::string::npos)
        << further << " gives: " << message_of(further);
  }
  EXPECT_EQ(message_of(""), "");
  v1::Scene scene = animated();
  scene.mutable_animation()->set_frames(0);
  EXPECT_FALSE(check_scene(scene).empty());
  scene.mutable_animation()->set_frames(kFrameLimit + 1);
  EXPECT_FALSE(check_scene(scene).empty());
  scene = animated();
  scene.mutable_cloths(0)->mutable_shell()->set_obj_file("cloth_%s.obj");
  EXPECT_FALSE(check_scene(scene).empty());
}

}  // namespace
}  // namespace weft::render
