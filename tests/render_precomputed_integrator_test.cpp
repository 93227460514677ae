#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render/draw.h"
#include "render/environment_cache.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "render/precomputed_integrator.h"
#include "render/shell_cloth.h"
#include "tests/render_lonely_fibre.h"

namespace weft::render {
namespace {

std::shared_ptr<const Fabric> fabric_with(float transfer) {
  return Fabric::from_database(test::lonely_fibre(transfer), Fabric::Wanted::kFibresAndTransfer);
}

FlatPlacement around_the_fibre() {
  FlatPlacement placement;
  placement.size_mm = {10, 10};
  placement.centre_mm = {0, -5, 0};
  placement.endless = true;
  return placement;
}

Scene scene_with(const std::shared_ptr<const Fabric>& fabric, const Light& light) {
  Scene scene;
  scene.cloths.push_back(make_flat_cloth(fabric, around_the_fibre()));
  Camera::View view;
  view.position_mm = {1, 0.5, 8};
  view.look_at_mm = {3.2, 0, 0};
  view.perspective = false;
  view.height = 0.07;
  scene.camera = Camera(view, 1.0);
  scene.lights.push_back(light);
  return scene;
}

Drawing drawing_of(const Scene& scene, const Integrator& integrator, std::uint32_t samples) {
  DrawSettings settings;
  settings.width = settings.height = 16;
  settings.samples_per_pixel = samples;
  settings.seed = 3;
  return draw(
      scene.camera, integrator, settings, [](double) {}, [] { return false; });
}

TEST(PrecomputedIntegrator, SingleScatteringOfALonelyFibreIsThePathTracers) {
  const auto fabric = fabric_with(0);
  const glm::dvec3 towards = glm::normalize(glm::dvec3(-0.3, 0.4, 1));
  const std::vector<Light> lights = {
      DirectionalLight{towards, {1, 2, 3}},
      SgLight{towards, 300, {1, 2, 3}},
      PointLight{{2, 0.5, 4}, {10, 10, 10}},
      RectangleLight{{1, 1, 3}, {2, 0, 0}, {0, -2, 0}, {1, 1, 1}},
      DiscLight{{2, -1, 2.5}, glm::normalize(glm::dvec3(-0.1, 0.2, -1)), 1.2, {2, 2, 2}},
      UniformLight{{0.4f, 0.4f, 0.4f}, true}};
  for (const Light& light : lights) {
    const Scene scene = scene_with(fabric, light);
    const PrecomputedIntegrator precomputed(scene, Scattering::kAll);
    PathSettings settings;
    settings.local = true;
    const PathIntegrator path(scene, settings);
    const Drawing a = drawing_of(scene, precomputed, 64);
    const Drawing b = drawing_of(scene, path, 64);
    EXPECT_EQ(a.cloth_share, 1);
    for (int c = 0; c < 3; ++c) {
      EXPECT_GT(b.cloth_mean[c], 0);
      const double error = std::hypot(a.cloth_standard_error[c], b.cloth_standard_error[c]);
      // Sidak for 18 comparisons at 0.01 together, and the rounding of the tables.
      EXPECT_LT(std::fabs(a.cloth_mean[c] - b.cloth_mean[c]), 3.5 * error + 1e-3 * b.cloth_mean[c])
          << "light " << light.index() << ": " << a.cloth_mean[c] << " against " << b.cloth_mean[c];
    }
  }
}

TEST(PrecomputedIntegrator, AnEnvironmentDrawnAsGaussiansLooksLikeOneOfDrawnDirections) {
  Image picture(32, 16);
  for (std::uint32_t y = 0; y < picture.height; ++y) {
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      picture.at(x, y) = glm::vec3(0.4f, 0.6f, 1.0f) * (1.5f - 0.05f * static_cast<float>(y));
    }
  }
  picture.at(20, 3) = glm::vec3(60, 50, 30);
  const auto environment = std::make_shared<Environment>(picture, glm::vec3(1), 0.4);
  // Followed by paths, which know nothing of Gaussians.
  Scene scene = scene_with(fabric_with(0), EnvironmentLight{environment, true});
  const PathIntegrator drawn(scene, {});
  const Drawing a = drawing_of(scene, drawn, 256);
  fit_environments(scene, {12, false}, {});
  EXPECT_GT(scene.lights.size(), 1U);
  const PathIntegrator fitted(scene, {});
  const Drawing b = drawing_of(scene, fitted, 64);
  for (int c = 0; c < 3; ++c) {
    const double error = std::hypot(a.cloth_standard_error[c], b.cloth_standard_error[c]);
    EXPECT_LT(error, 0.01 * a.cloth_mean[c]);
    EXPECT_NEAR(b.cloth_mean[c], a.cloth_mean[c], 0.03 * a.cloth_mean[c]);
  }
}

TEST(PrecomputedIntegrator, ConstantTransferShowsTheAdjointAlbedo) {
  // Light of irradiance E arrives as radiance E / (4 pi) from everywhere.
  const Scene scene = scene_with(
      fabric_with(1),
      DirectionalLight{glm::normalize(glm::dvec3(0.3, 0.4, 1)), glm::vec3(4 * 3.14159265f)});
  const PrecomputedIntegrator integrator(scene, Scattering::kMultipleOnly);
  const Drawing drawing = drawing_of(scene, integrator, 2);
  const glm::dvec3 towards_eye = glm::normalize(glm::dvec3(1, 0.5, 8) - glm::dvec3(3.2, 0, 0));
  const glm::vec3 expected = shading::FibreBcsdf(test::lonely_material())
                                 .adjoint_albedo(static_cast<float>(std::asin(towards_eye.x)));
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(drawing.cloth_mean[c], expected[c], 2e-3 * expected[c]);
  }
  const PrecomputedIntegrator single(scene, Scattering::kSingleOnly);
  const PrecomputedIntegrator all(scene, Scattering::kAll);
  EXPECT_NEAR(drawing_of(scene, all, 2).cloth_mean.x,
              drawing.cloth_mean.x + drawing_of(scene, single, 2).cloth_mean.x, 1e-6);
}

TEST(PrecomputedIntegrator, TheShadowOfMultipleScatteringIsSmoothedByTheGaussian) {
  // A second swatch high above covers x > edge: the shadow of a light from straight above is sharp
  // for single scattering and the Gaussian's distribution function for multiple scattering.
  const auto fabric = fabric_with(1);
  const double sigma_mm = 0.5;
  for (const double edge_mm : {-0.6, -0.25, 0.0, 0.3, 0.7}) {
    Scene scene = scene_with(fabric, DirectionalLight{{0, 0, 1}, {1, 1, 1}});
    Camera::View view;
    view.position_mm = {0, 0, 2};
    view.look_at_mm = {0, 0, 0};
    view.perspective = false;
    view.height = 0.02;
    scene.camera = Camera(view, 1.0);
    const PrecomputedIntegrator open(scene, Scattering::kMultipleOnly);
    const double unshadowed = drawing_of(scene, open, 1).cloth_mean.x;
    FlatPlacement roof;
    roof.size_mm = {40, 40};
    roof.centre_mm = {edge_mm + 20, 0, 5};
    scene.cloths.push_back(make_flat_cloth(fabric, roof));
    const PrecomputedIntegrator shadowed(scene, Scattering::kMultipleOnly);
    const Drawing drawing = drawing_of(scene, shadowed, 40);
    const double expected = 0.5 * std::erfc(-edge_mm / (sigma_mm * std::sqrt(2.0)));
    EXPECT_NEAR(drawing.cloth_mean.x / unshadowed, expected,
                3.1 * drawing.cloth_standard_error.x / unshadowed + 0.01);
    if (std::fabs(edge_mm) > 0.01) {  // wider than the picture
      const PrecomputedIntegrator single(scene, Scattering::kSingleOnly);
      EXPECT_EQ(drawing_of(scene, single, 1).cloth_mean.x > 0, edge_mm > 0);
    }
  }
}

TEST(PrecomputedIntegrator, TellsSingleFromMultipleScattering) {
  const Scene scene = scene_with(fabric_with(0.5f),
                                 SgLight{glm::normalize(glm::dvec3(0.3, 0.4, 1)), 300, {1, 2, 3}});
  const PrecomputedIntegrator both(scene, Scattering::kAll, true);
  const PrecomputedIntegrator single(scene, Scattering::kSingleOnly);
  const PrecomputedIntegrator multiple(scene, Scattering::kMultipleOnly);
  const Ray ray = scene.camera.ray({0.5, 0.5});
  core::Random random(1, 2);
  const EyeSample seen = both.trace(ray, random);
  EXPECT_TRUE(seen.on_cloth);
  EXPECT_EQ(seen.radiance, seen.single + seen.multiple);
  EXPECT_EQ(seen.single, single.trace(ray, random).radiance);
  EXPECT_EQ(seen.multiple, multiple.trace(ray, random).radiance);
  EXPECT_GT(seen.single.x, 0);
  EXPECT_GT(seen.multiple.x, 0);
  EXPECT_EQ(seen.shadow, 1.0f);
  EXPECT_LT(seen.segment, 2u);
}

}  // namespace
}  // namespace weft::render
