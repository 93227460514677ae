#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/moments.h"
#include "core/random.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "render/sphere_sampling.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

// Two-sided quantile of the normal distribution for `tests` tests at 0.01 together (Sidak).
double sidak_limit(int tests) {
  const double alpha = 1 - std::pow(0.99, 1.0 / tests);
  double low = 0;
  double high = 10;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::sqrt(2.0)) > alpha ? low : high) = middle;
  }
  return high;
}

shading::FibreMaterial silk_like() {
  shading::FibreMaterial material;
  material.c_r = {0.3f, 0.2f, 0.1f};
  material.c_tt = {0.6f, 0.5f, 0.4f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.35f;
  return material;
}

Scene scene_of(fabric::Tile tile, shading::FibreBcsdf bcsdf, FlatPlacement placement) {
  Scene scene;
  scene.cloths.push_back(make_flat_cloth(
      std::make_shared<Fabric>(std::move(tile), std::vector{std::move(bcsdf)}), placement));
  return scene;
}

FlatPlacement endless() {
  FlatPlacement placement;
  placement.size_mm = {1, 1};
  placement.endless = true;
  return placement;
}

void look_straight_down(Scene& scene, double height_mm) {
  Camera::View view;
  view.position_mm = {0.1, 0.2, 10};
  view.look_at_mm = {0.1, 0.2, 0};
  view.perspective = false;
  view.height = height_mm;
  scene.camera = Camera(view, 1.0);
}

Drawing drawing_of(const Scene& scene, const PathSettings& path, const DrawSettings& settings) {
  const PathIntegrator integrator(scene, path);
  return draw(
      scene.camera, integrator, settings, [](double) {}, [] { return false; });
}

DrawSettings small(std::uint32_t samples) {
  DrawSettings settings;
  settings.width = 16;
  settings.height = 16;
  settings.samples_per_pixel = samples;
  settings.seed = 7;
  settings.threads = 2;
  return settings;
}

TEST(PathIntegrator, InAFurnaceEveryCoveredPixelShowsOne) {
  Scene scene =
      scene_of(test::crossed_layers(4, 6, 0.05f, 2), shading::FibreBcsdf::furnace(), endless());
  look_straight_down(scene, 0.9);
  scene.lights.emplace_back(UniformLight{glm::vec3(1)});
  // Followed directions alone: every path has throughput 1 and ends in the light.
  PathSettings directions;
  directions.finding = PathSettings::Finding::kDirections;
  const Drawing exact = drawing_of(scene, directions, small(4));
  EXPECT_GT(exact.cloth_share, 0.5);
  EXPECT_NEAR(exact.cloth_mean.x, 1, 1e-5);
  // Lights drawn too: 1 within the noise, pixel by pixel.
  const DrawSettings settings = small(64);
  const Drawing drawing = drawing_of(scene, {}, settings);
  int covered = 0;
  std::vector<double> scores;
  for (std::size_t i = 0; i < drawing.image.pixels.size(); ++i) {
    const double error = drawing.standard_error.pixels[i].x;
    if (exact.image.pixels[i].x == 1.0f && error > 0) {
      scores.push_back((drawing.image.pixels[i].x - 1) / error);
      ++covered;
    }
  }
  ASSERT_GT(covered, 100);
  EXPECT_NEAR(drawing.cloth_mean.x, 1, 4 * drawing.cloth_standard_error.x);
  double sum_of_squares = 0;
  for (const double score : scores) {
    sum_of_squares += score * score;
  }
  EXPECT_LT(sum_of_squares / covered, 2);
}

TEST(PathIntegrator, LightAndDirectionSamplingAgree) {
  const std::vector<Light> lights = {
      SgLight{glm::normalize(glm::dvec3(0.4, 0.2, 1)), 20, {1, 2, 3}},
      RectangleLight{{-2, 1, 3}, {1.5, 0, 0.2}, {0, 1.5, 0}, {4, 3, 2}},
      DiscLight{{2, -1, 2.5}, glm::normalize(glm::dvec3(-0.5, 0.2, -1)), 1.2, {5, 5, 5}},
      UniformLight{{0.3f, 0.3f, 0.3f}, true}};
  // RectangleLight shines to the side of edge_a x edge_b: turn it down.
  using Finding = PathSettings::Finding;
  for (const Light& light : lights) {
    for (const bool local : {false, true}) {
      Scene scene = scene_of(test::crossed_layers(4, 6, 0.05f, 2), shading::FibreBcsdf(silk_like()),
                             endless());
      look_straight_down(scene, 0.9);
      Light facing = light;
      if (auto* rectangle = std::get_if<RectangleLight>(&facing)) {
        std::swap(rectangle->edge_a_mm, rectangle->edge_b_mm);
      }
      scene.lights.push_back(facing);
      std::array<Drawing, 3> drawings;
      for (const Finding finding : {Finding::kBoth, Finding::kLights, Finding::kDirections}) {
        PathSettings path;
        path.local = local;
        path.finding = finding;
        DrawSettings settings = small(200);
        settings.seed = 11 + static_cast<std::uint64_t>(finding);
        drawings[static_cast<std::size_t>(finding)] = drawing_of(scene, path, settings);
      }
      for (const auto& [a, b] : {std::pair{0, 1}, std::pair{0, 2}}) {
        const Drawing& first = drawings[static_cast<std::size_t>(a)];
        const Drawing& second = drawings[static_cast<std::size_t>(b)];
        EXPECT_GT(first.cloth_mean.x, 0);
        for (int c = 0; c < 3; ++c) {
          const double error =
              std::hypot(first.cloth_standard_error[c], second.cloth_standard_error[c]);
          EXPECT_LT(std::fabs(first.cloth_mean[c] - second.cloth_mean[c]), sidak_limit(48) * error)
              << "light " << light.index() << " local " << local << " pair " << a << b
              << " channel " << c << ": " << first.cloth_mean[c] << " " << second.cloth_mean[c];
        }
      }
    }
  }
}

fabric::Tile single_fibre() {
  fabric::Tile tile = test::empty_tile(10, 10);
  test::add_strand(tile, {{0, 5, 0}, {5, 5, 0}, {10, 5, 0}}, 0.05f, 1, 0);
  test::finish(tile);
  return tile;
}

TEST(PathIntegrator, AStraightFibreUnderADirectionalLightShowsItsBcsdf) {
  const shading::FibreBcsdf bcsdf(silk_like());
  FlatPlacement placement;
  placement.size_mm = {10, 10};  // flat (0, 0) is the centre: the fibre lies on a border at y = 5
  placement.centre_mm = {0, -5, 0};
  placement.endless = true;
  Scene scene = scene_of(single_fibre(), bcsdf, placement);
  Camera::View view;
  view.position_mm = {1, 0.0, 8};
  view.look_at_mm = {3.2, 0, 0};
  view.up = {0, 1, 0};
  view.perspective = false;
  view.height = 0.08;  // narrower than the fibre: it fills the picture
  scene.camera = Camera(view, 1.0);
  const glm::vec3 omega_o(glm::normalize(view.position_mm - view.look_at_mm));
  for (const glm::dvec3& light :
       {glm::dvec3(0.3, 0.4, 1), glm::dvec3(-0.2, 0.5, -1), glm::dvec3(0.2, -1, 0.1)}) {
    const glm::dvec3 towards = glm::normalize(light);
    scene.lights.clear();
    scene.lights.emplace_back(DirectionalLight{towards, {2, 2, 2}});
    // The fibre's tangent is x, so that world directions are in a frame of the fibre already.
    const glm::vec3 expected = 2.0f * bcsdf.evaluate_cos(glm::vec3(towards), omega_o);
    for (const bool local : {false, true}) {
      PathSettings path;
      path.local = local;
      const Drawing drawing = drawing_of(scene, path, small(1));
      const bool lit = !local || towards.z > 0;
      EXPECT_EQ(drawing.cloth_share, 1);
      for (const glm::vec3& pixel : drawing.image.pixels) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(pixel[c], lit ? expected[c] : 0.0f, 1e-4f * expected[c] + 1e-6f);
        }
      }
    }
  }
}

TEST(PathIntegrator, TheTurnOfASwatchTurnsItsFibres) {
  const shading::FibreBcsdf bcsdf(silk_like());
  const double turn = 0.7;
  FlatPlacement placement;
  placement.size_mm = {10, 10};
  placement.endless = true;
  placement.turn = turn;
  const glm::dvec3 across(-std::sin(turn), std::cos(turn), 0);
  const glm::dvec3 along(std::cos(turn), std::sin(turn), 0);
  placement.centre_mm = -5.0 * across;
  Scene scene = scene_of(single_fibre(), bcsdf, placement);
  Camera::View view;
  view.position_mm = 1.0 * along + glm::dvec3(0, 0, 5);
  view.look_at_mm = {0, 0, 0};
  view.up = across;
  view.perspective = false;
  view.height = 0.08;
  scene.camera = Camera(view, 1.0);
  const glm::dvec3 towards = glm::normalize(0.3 * along + 0.2 * across + glm::dvec3(0, 0, 1));
  scene.lights.emplace_back(DirectionalLight{towards, {1, 1, 1}});
  const auto in_fabric = [&](const glm::dvec3& v) {
    return glm::vec3(glm::dot(v, along), glm::dot(v, across), v.z);
  };
  const glm::vec3 expected =
      bcsdf.evaluate_cos(in_fabric(towards), in_fabric(glm::normalize(view.position_mm)));
  const Drawing drawing = drawing_of(scene, {}, small(1));
  EXPECT_EQ(drawing.cloth_share, 1);
  for (const glm::vec3& pixel : drawing.image.pixels) {
    EXPECT_NEAR(pixel.x, expected.x, 1e-4f * expected.x);
  }
}

TEST(PathIntegrator, ThePictureIsTheSameForAnyNumberOfThreads) {
  Scene scene =
      scene_of(test::crossed_layers(4, 6, 0.05f, 2), shading::FibreBcsdf(silk_like()), endless());
  look_straight_down(scene, 0.9);
  scene.lights.emplace_back(SgLight{glm::normalize(glm::dvec3(0.4, 0.2, 1)), 20, {1, 2, 3}});
  DrawSettings settings = small(4);
  settings.threads = 1;
  const Drawing one = drawing_of(scene, {}, settings);
  settings.threads = 3;
  const Drawing three = drawing_of(scene, {}, settings);
  EXPECT_EQ(one.image.pixels, three.image.pixels);
  EXPECT_EQ(one.cloth_mean, three.cloth_mean);
  settings.seed = 8;
  EXPECT_NE(one.image.pixels, drawing_of(scene, {}, settings).image.pixels);
}

TEST(PathIntegrator, ABlackSheetUnderTheClothHidesTheLightBelow) {
  for (const bool underlay : {false, true}) {
    FlatPlacement placement = endless();
    placement.black_underlay = underlay;
    Scene scene =
        scene_of(test::crossed_layers(1, 2, 0.05f, 1), shading::FibreBcsdf(silk_like()), placement);
    look_straight_down(scene, 0.9);
    scene.background = {1, 1, 1};
    scene.lights.emplace_back(DirectionalLight{{0, 0, -1}, {1, 1, 1}});
    const Drawing drawing = drawing_of(scene, {}, small(8));
    EXPECT_LT(drawing.cloth_share, 0.9);
    EXPECT_EQ(drawing.cloth_mean.x > 0, !underlay);
    // Between the fibres one sees the background, or the sheet.
    const glm::vec3 between(underlay ? 0.0f : 1.0f);
    EXPECT_GT(std::count(drawing.image.pixels.begin(), drawing.image.pixels.end(), between), 10);
  }
}

TEST(PathIntegrator, SingleAndMultipleScatteringAddUp) {
  Scene scene =
      scene_of(test::crossed_layers(4, 6, 0.05f, 2), shading::FibreBcsdf(silk_like()), endless());
  look_straight_down(scene, 0.9);
  scene.lights.emplace_back(DirectionalLight{glm::normalize(glm::dvec3(0.4, 0.2, 1)), {1, 1, 1}});
  std::array<Drawing, 3> drawings;
  for (const Scattering scattering :
       {Scattering::kAll, Scattering::kSingleOnly, Scattering::kMultipleOnly}) {
    PathSettings path;
    path.scattering = scattering;
    DrawSettings settings = small(200);
    settings.seed = 20 + static_cast<std::uint64_t>(scattering);
    drawings[static_cast<std::size_t>(scattering)] = drawing_of(scene, path, settings);
  }
  for (int c = 0; c < 3; ++c) {
    const double parts = drawings[1].cloth_mean[c] + drawings[2].cloth_mean[c];
    double variance = 0;
    for (const Drawing& drawing : drawings) {
      variance += std::pow(drawing.cloth_standard_error[c], 2);
    }
    EXPECT_GT(drawings[2].cloth_mean[c], 0);
    EXPECT_LT(std::fabs(parts - drawings[0].cloth_mean[c]), sidak_limit(3) * std::sqrt(variance));
  }
}

// Light that falls on lossless fibres leaves them again. The camera's estimator is not reciprocal,
// so that this says something: the power that leaves, integrated over both sides of the cloth and
// all directions, and the light that passes between the fibres, are the power that came.
TEST(PathIntegrator, LosslessFibresGiveBackThePowerTheyGet) {
  shading::FibreMaterial lossless = silk_like();
  lossless.c_r = {0.2f, 0.6f, 1.0f};
  lossless.c_tt = {1, 1, 1};
  lossless.beta_r = 0.3f;
  lossless.beta_tt = 0.2f;
  // Thin fibres far apart: within a fibre's width the light does not change.
  const fabric::Tile tile = test::crossed_layers(8, 12, 0.004f, 1);
  fabric::Tile spread = tile;
  for (glm::vec3& point : spread.points_mm) {
    point.z *= 20;
  }
  test::finish(spread);
  const double top_mm = spread.z_max_mm + 1e-3;
  const double bottom_mm = spread.z_min_mm - 1e-3;
  Scene scene = scene_of(std::move(spread), shading::FibreBcsdf(lossless), endless());
  const glm::dvec3 towards = glm::normalize(glm::dvec3(0.5, 0.3, 0.6));
  scene.lights.emplace_back(DirectionalLight{towards, {1, 1, 1}});
  const PathIntegrator integrator(scene, {});
  constexpr int kRays = 60000;
  glm::dvec3 sum(0);
  glm::dvec3 sum_of_squares(0);
  for (int i = 0; i < kRays; ++i) {
    core::Random random(5, 0, static_cast<std::uint64_t>(i));
    const bool above = i % 2 == 0;
    // A ray through a point of the surface, cosine-weighted: pdf cos / pi, so that each of the two
    // sides contributes pi L; and a ray of the light itself, which may pass.
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const double u3 = random.uniform_double();
    const double u4 = random.uniform_double();
    glm::dvec3 inward = direction_of(std::sqrt(1 - u1), 2 * kPi * u2);
    inward.z = above ? -inward.z : inward.z;
    const Ray ray{{u3, u4, above ? top_mm : bottom_mm}, inward};
    const glm::dvec3 leaving = 2 * kPi * glm::dvec3(integrator.trace(ray, random).radiance);
    const Ray beam{{u4, u3, top_mm}, -towards};
    const double passing =
        closest(scene, beam, kInfinity, nullptr).fate == Fate::kNothing ? towards.z : 0;
    const glm::dvec3 power = leaving + passing;
    sum += power;
    sum_of_squares += power * power;
  }
  for (int c = 0; c < 3; ++c) {
    const core::MeanAndError power = core::mean_and_error(sum[c], sum_of_squares[c], kRays);
    EXPECT_LT(std::fabs(power.mean - towards.z), sidak_limit(3) * power.standard_error)
        << power.mean << " +- " << power.standard_error << " against " << towards.z;
    EXPECT_LT(power.standard_error, 0.02 * towards.z);
  }
}

}  // namespace
}  // namespace weft::render
