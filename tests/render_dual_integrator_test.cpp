#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "render/baselines/dual_fibre.h"
#include "render/baselines/dual_integrator.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "shading/quadrature.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

using shading::kHalfPi;
using shading::kPi;

shading::FibreMaterial grey() {
  shading::FibreMaterial material;
  material.c_r = {0.3f, 0.2f, 0.1f};
  material.c_tt = {0.6f, 0.5f, 0.4f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.35f;
  return material;
}

glm::vec3 direction(float theta, float phi) {
  return {std::sin(theta), std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi)};
}

TEST(DualFibre, AveragesAreThePowerThatGoesOnAndBack) {
  // The power of S(i, o) cos(theta_o) in either half circle, over fibres turned anyhow.
  const shading::FibreBcsdf bcsdf(grey());
  const DualFibre fibre(bcsdf);
  const shading::QuadratureRule rule = shading::gauss_legendre(96);
  for (const float theta : {0.0f, 0.5f, -1.1f}) {
    glm::dvec3 forward(0);
    glm::dvec3 backward(0);
    const float low = std::max(-kHalfPi, -theta - 1.1f);
    const float high = std::min(kHalfPi, -theta + 1.1f);
    for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
      const float theta_o =
          0.5f * (low + high) + 0.5f * (high - low) * static_cast<float>(rule.nodes[k]);
      const double c = std::cos(static_cast<double>(theta_o));
      const double weight = rule.weights[k] * 0.5 * static_cast<double>(high - low) * c * c;
      constexpr int kPhis = 720;
      for (int p = 0; p < kPhis; ++p) {
        const float phi = (static_cast<float>(p) + 0.5f) * 2 * kPi / kPhis;
        const glm::dvec3 s(bcsdf.evaluate(direction(theta, 0), direction(theta_o, phi)));
        // Of azimuths of the light within half a circle, the share that sends phi back.
        const double off = std::min(phi, 2 * kPi - phi);
        const double back = 1 - off / static_cast<double>(kPi);
        backward += s * (weight * back * 2 * static_cast<double>(kPi) / kPhis);
        forward += s * (weight * (1 - back) * 2 * static_cast<double>(kPi) / kPhis);
      }
    }
    const DualFibre::Averages averages = fibre.averages(theta);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(averages.forward[c], forward[c], 3e-3) << theta;
      EXPECT_NEAR(averages.backward[c], backward[c], 3e-3) << theta;
    }
  }
}

TEST(DualFibre, WhatComesBackFromFibresIsNoMoreThanWhatWentIn) {
  core::Random random(5, 0);
  for (int i = 0; i < 16; ++i) {
    shading::FibreMaterial material;
    material.c_r = {random.uniform(), i % 2 == 0 ? 1.0f : random.uniform(), 0.0f};
    material.c_tt = {random.uniform(), random.uniform(), 1.0f};
    material.beta_r = 0.02f + 0.5f * random.uniform();
    material.beta_tt = 0.02f + 0.5f * random.uniform();
    material.gamma_tt = 0.1f + random.uniform();
    const DualFibre fibre{shading::FibreBcsdf(material)};
    for (int angle = 0; angle < 32; ++angle) {
      const DualFibre::Averages at = fibre.averages(kPi * (random.uniform() - 0.5f));
      const glm::vec3 returned = DualFibre::backward_attenuation(at);
      for (int c = 0; c < 3; ++c) {
        EXPECT_LE(at.forward[c] + at.backward[c], 1 + 1e-5f);
        EXPECT_GE(returned[c], 0);
        EXPECT_LE(at.backward[c] + returned[c], 1 + 1e-4f);
      }
    }
  }
}

TEST(DualFibre, SpreadLightScattersAsTheIntegralOverItsDirections) {
  const shading::FibreBcsdf bcsdf(grey());
  const DualFibre fibre(bcsdf);
  const float phi_d = 0.4f;
  for (const float variance : {0.02f, 0.15f}) {
    for (const float theta_d : {0.1f, -0.7f}) {
      for (const float straight : {0.0f, 1.3f, -2.6f}) {
        const float theta_o = -theta_d + 0.15f;
        const glm::vec3 omega_o = direction(theta_o, phi_d + kPi + straight);
        glm::dvec3 sum(0);
        double power = 0;  // of the spread light's longitudes
        constexpr int kThetas = 300;
        constexpr int kPhis = 60;
        for (int t = 0; t < kThetas; ++t) {
          const double theta = (t + 0.5) / kThetas * static_cast<double>(kPi) - kHalfPi;
          const double d = theta - static_cast<double>(theta_d);
          const double c2 = std::cos(theta) * std::cos(theta);
          const double g = std::exp(-0.5 * d * d / static_cast<double>(variance));
          power += g * c2;
          for (int p = 0; p < kPhis; ++p) {
            const float phi = phi_d + (static_cast<float>(p) + 0.5f) / kPhis * kPi - kHalfPi;
            sum += glm::dvec3(bcsdf.evaluate(direction(static_cast<float>(theta), phi), omega_o)) *
                   (g * c2 / kPhis);
          }
        }
        const glm::dvec3 expected = sum * (std::cos(static_cast<double>(theta_d)) / power);
        const glm::vec3 found = fibre.scattered(theta_d, theta_o, straight, variance);
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(found[c], expected[c], 5e-3 * expected[c] + 1e-5)
              << variance << " " << theta_d << " " << straight;
        }
      }
    }
  }
}

TEST(DualFibre, ReturnedLightCarriesThePowerOfItsAttenuation) {
  // Over all directions of the eye, as seen by light across narrow fibres: A_b and no more.
  shading::FibreMaterial narrow = grey();
  narrow.beta_r = narrow.beta_tt = 0.02f;
  const DualFibre fibre{shading::FibreBcsdf(narrow)};
  double power = 0;
  constexpr int kThetas = 400;
  constexpr int kPhis = 16;
  for (int t = 0; t < kThetas; ++t) {
    const double theta = 0.6 * (2 * (t + 0.5) / kThetas - 1);
    for (int p = 0; p < kPhis; ++p) {
      const double straight = static_cast<double>(kPi) * (2 * (p + 0.5) / kPhis - 1);
      const float seen =
          fibre.returned(0, static_cast<float>(theta), static_cast<float>(straight), 0).x;
      power += static_cast<double>(seen) * std::cos(theta) * std::cos(theta) * 1.2 / kThetas * 2 *
               static_cast<double>(kPi) / kPhis;
    }
  }
  EXPECT_NEAR(power, DualFibre::backward_attenuation(fibre.averages(0)).x, 0.01 * power);
}

// `count` straight fibres along x, one above the other, in a tile much wider than they.
Scene column_of_fibres(int count, const DirectionalLight& light) {
  fabric::Tile tile = test::empty_tile(1, 1);
  for (int i = 0; i < count; ++i) {
    const float z = 0.05f + 0.2f * static_cast<float>(i);
    test::add_strand(tile, {{0, 0.5f, z}, {0.5f, 0.5f, z}, {1, 0.5f, z}}, 0.05f, 1, 0);
  }
  test::finish(tile);
  Scene scene;
  FlatPlacement placement;
  placement.size_mm = {1, 1};
  placement.endless = true;
  scene.cloths.push_back(make_flat_cloth(
      std::make_shared<Fabric>(std::move(tile), std::vector{shading::FibreBcsdf(grey())}),
      placement));
  scene.lights.emplace_back(light);
  return scene;
}

void look(Scene& scene, const glm::dvec3& from_mm) {
  Camera::View view;
  view.position_mm = glm::dvec3(0.3, 0.5, 0.05) + from_mm;
  view.look_at_mm = {0.3, 0.5, 0.05};
  view.up = {0, 1, 0};
  view.perspective = false;
  view.height = 0.02;
  scene.camera = Camera(view, 1.0);
}

Drawing drawing_of(const Scene& scene, const Integrator& integrator) {
  DrawSettings settings;
  settings.width = settings.height = 4;
  settings.samples_per_pixel = 4;
  return draw(
      scene.camera, integrator, settings, [](double) {}, [] { return false; });
}

TEST(DualIntegrator, DirectLightScattersAsOnThePathTracersFibre) {
  Scene scene = column_of_fibres(1, {glm::normalize(glm::dvec3(0.4, 0.2, 1)), glm::vec3(1, 2, 3)});
  look(scene, {-3, 1, 8});
  PathSettings single;
  single.scattering = Scattering::kSingleOnly;
  for (const bool local : {false, true}) {
    single.local = local;
    const PathIntegrator path(scene, single);
    const DualIntegrator dual(scene, local, Scattering::kSingleOnly);
    const glm::dvec3 expected = drawing_of(scene, path).cloth_mean;
    const glm::dvec3 found = drawing_of(scene, dual).cloth_mean;
    for (int c = 0; c < 3; ++c) {
      EXPECT_GT(expected[c], 0.01);
      EXPECT_NEAR(found[c], expected[c], 1e-6 * expected[c]);
    }
  }
}

TEST(DualIntegrator, EveryFibreInTheWayAttenuatesAndSpreads) {
  const DualFibre fibre{shading::FibreBcsdf(grey())};
  const DualFibre::Averages averages = fibre.averages(0);
  glm::vec3 share(1);
  for (int above = 1; above <= 3; ++above) {
    Scene scene = column_of_fibres(above + 1, {{0, 0, 1}, glm::vec3(2)});
    look(scene, {0, 0, -8});  // the lowest fibre, from below
    share *= averages.forward;
    const float variance = static_cast<float>(above) * averages.forward_variance;
    const glm::vec3 expected =
        2.0f * share * (fibre.scattered(0, 0, 0, variance) + fibre.returned(0, 0, 0, variance));
    for (const bool local : {false, true}) {
      const DualIntegrator dual(scene, local, Scattering::kMultipleOnly);
      const DualIntegrator single(scene, local, Scattering::kSingleOnly);
      const glm::dvec3 found = drawing_of(scene, dual).cloth_mean;
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(found[c], expected[c], 1e-4 * static_cast<double>(expected[c]));
      }
      EXPECT_EQ(drawing_of(scene, single).cloth_mean.x, 0);
    }
  }
}

}  // namespace
}  // namespace weft::render
