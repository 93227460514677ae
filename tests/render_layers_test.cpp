#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/draw.h"
#include "render/drawing_channels.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

shading::FibreMaterial silk_like() {
  shading::FibreMaterial material;
  material.c_r = {0.3f, 0.2f, 0.1f};
  material.c_tt = {0.6f, 0.5f, 0.4f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.35f;
  return material;
}

std::unique_ptr<Cloth> crossed_fibres(const glm::dvec3& centre_mm, double size_mm) {
  FlatPlacement placement;
  placement.size_mm = {size_mm, size_mm};
  placement.centre_mm = centre_mm;
  return make_flat_cloth(std::make_shared<Fabric>(test::crossed_layers(4, 6, 0.05f, 2),
                                                  std::vector{shading::FibreBcsdf(silk_like())}),
                         placement);
}

// A swatch seen from straight above, larger than the view, and directional light from the right.
Scene lit_swatch() {
  Scene scene;
  scene.cloths.push_back(crossed_fibres({0, 0, 0}, 4));
  scene.background = {9, 9, 9};
  scene.lights.emplace_back(
      DirectionalLight{glm::normalize(glm::dvec3(1, 0, 1)), glm::vec3(1, 2, 3)});
  Camera::View view;
  view.position_mm = {0, 0, 3};
  view.look_at_mm = {0, 0, 0};
  view.perspective = false;
  view.height = 1.5;
  scene.camera = Camera(view, 1.0);
  return scene;
}

DrawSettings with_layers(std::uint32_t samples) {
  DrawSettings settings;
  settings.width = settings.height = 16;
  settings.samples_per_pixel = samples;
  settings.seed = 5;
  settings.layers = LayerSet::all();
  return settings;
}

Drawing drawing_of(const Scene& scene, const DrawSettings& settings) {
  PathSettings path;
  path.wants_shadow = true;
  const PathIntegrator integrator(scene, path);
  return draw(
      scene.camera, integrator, settings, [](double) {}, [] { return false; });
}

TEST(Layers, SingleAndMultipleAddUpToWhatTheClothSends) {
  Scene scene = lit_swatch();
  scene.background = glm::vec3(0);
  const Drawing drawing = drawing_of(scene, with_layers(8));
  glm::vec3 single(0);
  glm::vec3 multiple(0);
  for (std::size_t i = 0; i < drawing.image.pixels.size(); ++i) {
    const glm::vec3 sum = drawing.layers.single[i] + drawing.layers.multiple[i];
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(sum[c], drawing.image.pixels[i][c], 1e-5f * (1 + sum[c]));
    }
    single += drawing.layers.single[i];
    multiple += drawing.layers.multiple[i];
  }
  EXPECT_GT(single.x, 0);
  EXPECT_GT(multiple.x, 0);
}

TEST(Layers, TheSurfaceIsThatOfTheFirstSample) {
  const Scene scene = lit_swatch();
  const std::uint32_t segments = scene.cloths[0]->fabric().tile().segment_count();
  const Drawing one = drawing_of(scene, with_layers(1));
  const Drawing more = drawing_of(scene, with_layers(4));
  EXPECT_EQ(one.layers.segment, more.layers.segment);
  EXPECT_EQ(one.layers.tangent, more.layers.tangent);
  int seen = 0;
  for (std::size_t i = 0; i < one.layers.segment.size(); ++i) {
    if (one.layers.segment[i] == kNoSegment) {
      EXPECT_EQ(one.image.pixels[i], scene.background);
      EXPECT_EQ(one.layers.cloth[i], kNoSegment);
      continue;
    }
    ++seen;
    EXPECT_LT(one.layers.segment[i], segments);
    EXPECT_EQ(one.layers.cloth[i], 0u);
    EXPECT_NEAR(glm::length(one.layers.tangent[i]), 1, 1e-5);
    EXPECT_NEAR(one.layers.normal[i].z, 1, 1e-6);
    EXPECT_NEAR(glm::dot(one.layers.normal[i], one.layers.tangent[i]), 0, 1e-5);
  }
  EXPECT_GT(seen, 100);
}

TEST(Layers, ShadowIsTheShareOfTheLightsIrradianceThatOtherClothLetsThrough) {
  Scene scene = lit_swatch();
  // A second piece between the first light and the swatch, out of the camera's sight; and a light
  // of a third of the irradiance from the other side that it does not hide.
  scene.cloths.push_back(crossed_fibres({5, 0, 5}, 4));
  scene.lights.emplace_back(
      DirectionalLight{glm::normalize(glm::dvec3(-1, 0, 1)), glm::vec3(1, 1, 0)});
  const Drawing drawing = drawing_of(scene, with_layers(4));
  for (std::size_t i = 0; i < drawing.layers.shadow.size(); ++i) {
    if (drawing.layers.segment[i] != kNoSegment) {
      EXPECT_NEAR(drawing.layers.shadow[i], 0.25f, 1e-6f);
    }
  }
  scene.cloths.pop_back();
  const Drawing open = drawing_of(scene, with_layers(4));
  for (std::size_t i = 0; i < open.layers.shadow.size(); ++i) {
    if (open.layers.segment[i] != kNoSegment) {
      EXPECT_EQ(open.layers.shadow[i], 1.0f);
    }
  }
}

TEST(Layers, TheColourDoesNotDependOnWhatElseIsWanted) {
  const Scene scene = lit_swatch();
  DrawSettings plain = with_layers(4);
  plain.layers = {};
  const PathIntegrator integrator(scene, {});
  const Drawing without = draw(
      scene.camera, integrator, plain, [](double) {}, [] { return false; });
  const Drawing with = drawing_of(scene, with_layers(4));
  EXPECT_EQ(without.image.pixels, with.image.pixels);
  EXPECT_TRUE(without.layers.single.empty());
}

TEST(Layers, APictureInPassesIsTheSameBitByBit) {
  const Scene scene = lit_swatch();
  const DrawSettings settings = with_layers(7);
  const Drawing whole = drawing_of(scene, settings);
  PathSettings path;
  path.wants_shadow = true;
  const PathIntegrator integrator(scene, path);
  GrowingDrawing growing(settings);
  for (const std::uint32_t count : {1u, 2u, 4u}) {
    growing.add_samples(
        scene.camera, integrator, count, [](double) {}, [] { return false; });
  }
  const Drawing grown = growing.drawing();
  EXPECT_EQ(growing.samples(), 7u);
  EXPECT_EQ(grown.image.pixels, whole.image.pixels);
  EXPECT_EQ(grown.standard_error.pixels, whole.standard_error.pixels);
  EXPECT_EQ(grown.layers.multiple, whole.layers.multiple);
  EXPECT_EQ(grown.layers.shadow, whole.layers.shadow);
  EXPECT_EQ(grown.cloth_mean, whole.cloth_mean);
}

TEST(Layers, AreWrittenUnderTheirNamesAndReadBack) {
  Drawing drawing = drawing_of(lit_swatch(), with_layers(4));
  attach_layers(drawing, parse_layers("single,segment,normal,shadow,variance"));
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / "weft_layers_test.exr";
  write_exr(file, drawing.image, ExrPixels::kFloat);
  EXPECT_EQ(read_exr(file).pixels, drawing.image.pixels);
  EXPECT_EQ(read_exr(file, "single").pixels, drawing.layers.single);
  EXPECT_EQ(read_exr(file, "normal").pixels, drawing.layers.normal);
  EXPECT_EQ(read_exr(file, "shadow").pixels[9], glm::vec3(drawing.layers.shadow[9]));
  const glm::vec3 error = drawing.standard_error.pixels[20];
  EXPECT_EQ(read_exr(file, "variance").pixels[20], error * error);
  EXPECT_THROW(static_cast<void>(read_exr(file, "multiple")), core::Error);
  EXPECT_THROW(static_cast<void>(read_exr(file, "segment")), core::Error);
  std::filesystem::remove(file);
}

TEST(Layers, TheirNamesAreReadAsTheyAreWritten) {
  EXPECT_EQ(parse_layers("all"), LayerSet::all());
  EXPECT_TRUE(parse_layers("").empty());
  EXPECT_EQ(layers_text(parse_layers("shadow,single")), "single,shadow");
  EXPECT_THROW(static_cast<void>(parse_layers("single,shade")), core::Error);
  v1::Picture picture;
  set_layers(parse_layers("tangent,variance"), picture);
  EXPECT_EQ(layers_text(layers_of(picture)), "tangent,variance");
}

}  // namespace
}  // namespace weft::render
