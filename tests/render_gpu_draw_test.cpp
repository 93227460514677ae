#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/flat_cloth.h"
#include "render/gpu/draw_on_device.h"
#include "render/precomputed_integrator.h"
#include "render/shell_cloth.h"
#include "tests/render_random_fabric.h"

// Whole pictures by the device against those of the CPU.

namespace weft::render::gpu {
namespace {

DeviceRenderer& renderer() {
  static DeviceRenderer made({}, {Validation::kOn, false});
  return made;
}

const glm::dvec3 kTowards = glm::normalize(glm::dvec3(-0.3, 0.4, 1));

std::unique_ptr<Cloth> flat_cloth(const std::shared_ptr<const Fabric>& fabric,
                                  const glm::dvec3& centre_mm, double size_mm) {
  FlatPlacement placement;
  placement.size_mm = {size_mm, size_mm};
  placement.centre_mm = centre_mm;
  placement.turn = 0.4;
  placement.black_underlay = true;
  return make_flat_cloth(fabric, placement);
}

// A bent sheet of 4 x 4 mm.
std::unique_ptr<Cloth> bent_cloth(const std::shared_ptr<const Fabric>& fabric) {
  constexpr int kSteps = 6;
  ObjMesh mesh;
  const auto texture = [](int x, int y) {
    return glm::dvec2(static_cast<double>(x) / kSteps, static_cast<double>(y) / kSteps);
  };
  for (int y = 0; y <= kSteps; ++y) {
    for (int x = 0; x <= kSteps; ++x) {
      const glm::dvec2 at = texture(x, y);
      mesh.points.emplace_back(4 * at.x - 2, 4 * at.y - 2, 0.5 * std::sin(3 * at.x + at.y));
    }
  }
  const auto add = [&](const std::array<glm::ivec2, 3>& corners) {
    ObjMesh::Triangle triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      triangle.points[i] = static_cast<std::uint32_t>(corners[i].y * (kSteps + 1) + corners[i].x);
      triangle.texture[i] = texture(corners[i].x, corners[i].y);
    }
    mesh.triangles.push_back(triangle);
  };
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x) {
      add({glm::ivec2(x, y), glm::ivec2(x + 1, y), glm::ivec2(x + 1, y + 1)});
      add({glm::ivec2(x, y), glm::ivec2(x + 1, y + 1), glm::ivec2(x, y + 1)});
    }
  }
  std::vector<std::string> remarks;
  return make_shell_cloth(fabric, mesh, {}, remarks);
}

void look(Scene& scene) {
  Camera::View view;
  view.position_mm = {2, -5, 9};
  view.look_at_mm = {0, 0, 0};
  view.up = {0, 1, 0};
  view.height = 0.4;
  scene.camera = Camera(view, 1.0);
  scene.background = {0.1f, 0.2f, 0.3f};
}

DeviceDrawSettings settings_of(std::uint32_t samples) {
  DeviceDrawSettings settings;
  settings.picture.width = 40;
  settings.picture.height = 32;
  settings.picture.samples_per_pixel = samples;
  settings.picture.seed = 5;
  settings.picture.layers = LayerSet::all();
  return settings;
}

Drawing on_device(const Scene& scene, const DeviceDrawSettings& settings) {
  return draw_on_device(
      renderer(), scene, settings, [](double) {}, [] { return false; });
}

Drawing on_cpu(const Scene& scene, const DeviceDrawSettings& settings) {
  const PrecomputedIntegrator integrator(scene, settings.scattering, true);
  return draw(
      scene.camera, integrator, settings.picture, [](double) {}, [] { return false; });
}

// Means over the cloth within one percent, or what the noise of both explains; single pixels within
// their noise but for a few.
void expect_same_picture(const Drawing& device, const Drawing& cpu, const std::string& what) {
  EXPECT_NEAR(device.cloth_share, cpu.cloth_share, 0.002) << what;
  for (int c = 0; c < 3; ++c) {
    const double noise =
        3 * std::hypot(device.cloth_standard_error[c], cpu.cloth_standard_error[c]);
    EXPECT_NEAR(device.cloth_mean[c], cpu.cloth_mean[c], 0.01 * cpu.cloth_mean[c] + noise) << what;
    EXPECT_NEAR(device.cloth_standard_error[c], cpu.cloth_standard_error[c],
                0.25 * cpu.cloth_standard_error[c])
        << what;
  }
  std::size_t apart = 0;
  for (std::size_t i = 0; i < cpu.image.pixels.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float seen = device.image.pixels[i][c];
      ASSERT_TRUE(std::isfinite(seen) && seen >= 0) << what;
      const float noise =
          std::hypot(device.standard_error.pixels[i][c], cpu.standard_error.pixels[i][c]);
      const float expected = cpu.image.pixels[i][c];
      apart += std::fabs(seen - expected) > 6 * noise + 0.02f * expected + 1e-3f ? 1 : 0;
    }
  }
  EXPECT_LT(apart, cpu.image.pixels.size() * 3 / 50) << what;
}

TEST(DeviceDrawing, DrawsThePictureOfTheCpuUnderEveryLight) {
  const auto fabric = random_fabric({});
  const std::vector<std::vector<Light>> cases = {
      {DirectionalLight{kTowards, {1, 2, 3}}},
      {SgLight{kTowards, 120, {1, 2, 3}, true}},
      {PointLight{{2, 0.5, 4}, {10, 20, 10}}},
      {RectangleLight{{1, 1, 3}, {1, 0, 0}, {0, -1, 0}, {1, 1, 1}}},
      {DiscLight{{2, -1, 4}, glm::normalize(glm::dvec3(-0.1, 0.2, -1)), 0.6, {2, 2, 2}}},
      {DirectionalLight{kTowards, {1, 2, 3}}, PointLight{{2, 0.5, 4}, {10, 20, 10}},
       SgLight{glm::normalize(glm::dvec3(0.5, 0.2, 1)), 15, {2, 1, 1}}}};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    Scene scene;
    look(scene);
    scene.cloths.push_back(flat_cloth(fabric, {0, 0, 0}, 3.5));
    scene.lights = cases[i];
    const DeviceDrawSettings settings = settings_of(24);
    expect_same_picture(on_device(scene, settings), on_cpu(scene, settings),
                        "lights " + std::to_string(i));
  }
  EXPECT_TRUE(renderer().device().complaints().empty());
}

TEST(DeviceDrawing, DrawsShellsAndSeveralFabricsWithTheirShadows) {
  RandomFabric coarse;
  coarse.seed = 2;
  coarse.order = 4;
  coarse.gaussians = 7;
  coarse.components = 3;
  coarse.sigma_shadow_mm = 0.5f;
  Scene scene;
  look(scene);
  scene.cloths.push_back(bent_cloth(random_fabric({})));
  scene.cloths.push_back(flat_cloth(random_fabric(coarse), {0.5, 0.3, 2}, 1.2));
  scene.lights = {DirectionalLight{kTowards, {1, 2, 3}},
                  SgLight{glm::normalize(glm::dvec3(0.5, 0.2, 1)), 15, {2, 1, 1}}};
  const DeviceDrawSettings settings = settings_of(24);
  const Drawing device = on_device(scene, settings);
  const Drawing cpu = on_cpu(scene, settings);
  expect_same_picture(device, cpu, "shell");
  std::size_t other_segments = 0;
  std::size_t other_directions = 0;
  std::size_t shadowed = 0;
  double shadow_device = 0;
  double shadow_cpu = 0;
  for (std::size_t i = 0; i < cpu.image.pixels.size(); ++i) {
    const bool same = device.layers.segment[i] == cpu.layers.segment[i] &&
                      device.layers.cloth[i] == cpu.layers.cloth[i];
    other_segments += same ? 0 : 1;
    other_directions +=
        same && (glm::distance(device.layers.tangent[i], cpu.layers.tangent[i]) > 1e-4f ||
                 glm::distance(device.layers.normal[i], cpu.layers.normal[i]) > 1e-4f)
            ? 1
            : 0;
    shadowed += cpu.layers.cloth[i] == 0 && cpu.layers.shadow[i] < 0.8f ? 1 : 0;
    shadow_device += static_cast<double>(device.layers.shadow[i]);
    shadow_cpu += static_cast<double>(cpu.layers.shadow[i]);
  }
  EXPECT_LT(other_segments, cpu.image.pixels.size() / 100);
  EXPECT_LT(other_directions, cpu.image.pixels.size() / 100);
  EXPECT_NEAR(shadow_device, shadow_cpu, 0.02 * shadow_cpu);
  EXPECT_GT(shadowed, 20U);
  EXPECT_TRUE(renderer().device().complaints().empty());
}

Scene small_scene() {
  Scene scene;
  look(scene);
  scene.cloths.push_back(bent_cloth(random_fabric({})));
  scene.lights = {SgLight{kTowards, 60, {1, 2, 3}}};
  return scene;
}

TEST(DeviceDrawing, DoesNotDependOnBandsSubmissionsAndPasses) {
  const Scene scene = small_scene();
  const DeviceDrawSettings settings = settings_of(7);
  const Drawing whole = on_device(scene, settings);
  DeviceDrawSettings pieces = settings;
  pieces.most_rays = 300;
  pieces.most_pixels = 170;
  DeviceDrawing growing(renderer(), scene, pieces);
  for (const std::uint32_t count : {1U, 4U, 2U}) {
    growing.add_samples(
        count, [](double) {}, [] { return false; });
  }
  const Drawing grown = growing.drawing();
  EXPECT_EQ(growing.samples(), 7U);
  EXPECT_EQ(grown.image.pixels, whole.image.pixels);
  EXPECT_EQ(grown.standard_error.pixels, whole.standard_error.pixels);
  EXPECT_EQ(grown.layers.shadow, whole.layers.shadow);
  EXPECT_EQ(grown.layers.segment, whole.layers.segment);
  EXPECT_EQ(grown.cloth_mean, whole.cloth_mean);
}

TEST(DeviceDrawing, StopsBetweenSubmissionsAndTellsItsProgress) {
  const Scene scene = small_scene();
  DeviceDrawSettings settings = settings_of(8);
  settings.most_rays = 512;
  int asked = 0;
  try {
    static_cast<void>(draw_on_device(
        renderer(), scene, settings, [](double) {}, [&] { return ++asked == 5; }));
    FAIL() << "was not cancelled";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kCancelled);
  }
  EXPECT_EQ(asked, 5);
  double last = 0;
  static_cast<void>(draw_on_device(
      renderer(), scene, settings,
      [&](double share) {
        EXPECT_GE(share, last);
        last = share;
      },
      [] { return false; }));
  EXPECT_EQ(last, 1.0);
}

TEST(DeviceDrawing, GoesOnOnceWhereTheDeviceWasLost) {
  const Scene scene = small_scene();
  DeviceDrawSettings settings = settings_of(4);
  settings.most_rays = 512;
  settings.most_pixels = 400;
  const Drawing undisturbed = on_device(scene, settings);
  DeviceRenderer own({}, {Validation::kOn, false});
  int asked = 0;
  // As a submission does that finds the device gone.
  const auto lose = [&](int first, int second) {
    ++asked;
    if (asked == first || asked == second) {
      throw core::Error(core::Code::kUnavailable, "the device was lost");
    }
    return false;
  };
  const Drawing resumed = draw_on_device(
      own, scene, settings, [](double) {}, [&] { return lose(12, -1); });
  EXPECT_EQ(resumed.image.pixels, undisturbed.image.pixels);
  EXPECT_GT(asked, 12);
  asked = 0;
  EXPECT_THROW(static_cast<void>(draw_on_device(
                   own, scene, settings, [](double) {}, [&] { return lose(3, 6); })),
               core::Error);
  EXPECT_EQ(asked, 6);
}

TEST(DeviceDrawing, KeepsFabricsBetweenPicturesAndDropsThoseThatAreGone) {
  DeviceRenderer own;
  const DeviceDrawSettings settings = settings_of(1);
  const auto draw_with = [&](const std::shared_ptr<const Fabric>& fabric) {
    Scene scene;
    look(scene);
    scene.cloths.push_back(flat_cloth(fabric, {0, 0, 0}, 3));
    scene.lights = {DirectionalLight{kTowards, {1, 1, 1}}};
    static_cast<void>(draw_on_device(
        own, scene, settings, [](double) {}, [] { return false; }));
  };
  const auto first = random_fabric({});
  draw_with(first);
  const std::uint64_t used_bytes = own.device().used_bytes();
  EXPECT_GT(used_bytes, 0U);
  draw_with(first);
  EXPECT_EQ(own.device().used_bytes(), used_bytes);
  draw_with(random_fabric({2}));
  EXPECT_EQ(own.kept_fabrics(), 2U);
  draw_with(first);
  EXPECT_EQ(own.kept_fabrics(), 1U);
  EXPECT_EQ(own.device().used_bytes(), used_bytes);
}

TEST(DeviceDrawing, RefusesWhatDoesNotFitBeforeItUploadsAnything) {
  const auto fabric = random_fabric({});
  const std::uint64_t before = renderer().device().used_bytes();
  try {
    static_cast<void>(renderer().tables_of({fabric.get()}, std::uint64_t{1} << 50));
    FAIL() << "took a pebibyte";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
    EXPECT_NE(std::string(error.what()).find(" MiB"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("--device cpu"), std::string::npos);
  }
  EXPECT_LE(renderer().device().used_bytes(), before);
}

}  // namespace
}  // namespace weft::render::gpu
