#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <gtest/gtest.h>

#include "core/moments.h"
#include "core/random.h"
#include "render/flat_cloth.h"
#include "render/path_integrator.h"
#include "tests/transport_tiles.h"

namespace weft::render {
namespace {

constexpr int kRays = 60000;
// Two-sided 0.01 over 3 channels of 12 comparisons (Sidak).
constexpr double kLimit = 3.63;

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

shading::FibreMaterial broad() {
  shading::FibreMaterial material;
  material.c_r = {0.3f, 0.2f, 0.1f};
  material.c_tt = {0.9f, 0.7f, 0.5f};
  material.beta_r = 0.12f;
  material.beta_tt = 0.17f;
  material.gamma_tt = 0.35f;
  return material;
}

// Reflection red and one degree wide, transmission grey.
shading::FibreMaterial narrow() {
  shading::FibreMaterial material;
  material.c_r = {0.745f, 0.008f, 0.07f};
  material.c_tt = {0.62f, 0.553f, 0.562f};
  material.beta_r = 0.0175f;
  material.beta_tt = 0.1745f;
  material.gamma_tt = 0.346f;
  return material;
}

Scene scene_of(const shading::FibreMaterial& material, std::vector<Light> lights, int layers = 6) {
  FlatPlacement placement;
  placement.size_mm = {1, 1};
  placement.endless = true;
  Scene scene;
  scene.cloths.push_back(
      make_flat_cloth(std::make_shared<Fabric>(test::crossed_layers(layers, 8, 0.05f, 2),
                                               std::vector{shading::FibreBcsdf(material)}),
                      placement));
  scene.lights = std::move(lights);
  return scene;
}

Light sun() { return DirectionalLight{glm::normalize(glm::dvec3(0.4, 0.2, 1)), {1, 2, 3}}; }
Light sky() { return SgLight{glm::normalize(glm::dvec3(-0.5, 0.3, 1)), 15, {3, 2, 1}}; }
Light lamp() {
  return DiscLight{{2, -1, 2.5}, glm::normalize(glm::dvec3(-0.5, 0.2, -1)), 1, {5, 5, 5}};
}
Light bulb() { return PointLight{{0.3, 0.4, -2}, {4, 4, 8}}; }

// A path as it can be followed without odds, lobes apart, or multiple importance sampling: every
// fibre asks every light, FibreBcsdf::sample says where the path goes on, and roulette by its
// throughput ends it.
glm::vec3 plain_radiance(const Scene& scene, Ray ray, core::Random& random) {
  glm::vec3 sum(0);
  glm::vec3 throughput(1);
  SceneMeeting met = closest(scene, ray, kInfinity, nullptr);
  while (met.fate == Fate::kFibre) {
    const FibreHit& hit = met.hit.fibre;
    const shading::FibreBcsdf& bcsdf =
        scene.cloths.front()->fabric(hit).bcsdf_of_strand(hit.copy.strand);
    const glm::vec3 towards_eye(-ray.direction);
    const glm::mat3 to_fibre =
        shading::fibre_frame(hit.tangent, hit.to_flat * towards_eye) * hit.to_flat;
    const glm::vec3 omega_o = to_fibre * towards_eye;
    for (const Light& light : scene.lights) {
      const double u1 = random.uniform_double();
      const LightSample sample = sample_light(light, hit.world_mm, u1, random.uniform_double());
      const Ray shadow{hit.world_mm, sample.direction};
      if (closest(scene, shadow, sample.distance_mm, &met.hit).fate == Fate::kNothing) {
        sum += throughput * sample.radiance / static_cast<float>(sample.pdf) *
               bcsdf.evaluate_cos(to_fibre * glm::vec3(sample.direction), omega_o);
      }
    }
    const float u_lobe = random.uniform();
    const float u_theta = random.uniform();
    const shading::BcsdfSample next = bcsdf.sample(omega_o, u_lobe, u_theta, random.uniform());
    throughput *= next.weight;
    const float survival = std::min(1.0f, largest(throughput));
    if (!(next.pdf > 0) || random.uniform() >= survival) {
      break;
    }
    throughput /= survival;
    const glm::vec3 direction = glm::transpose(to_fibre) * next.omega_i;
    ray = {hit.world_mm, glm::normalize(glm::dvec3(direction))};
    const SceneHit from = met.hit;
    met = closest(scene, ray, kInfinity, &from);
  }
  return sum;
}

struct Estimate {
  std::array<core::MeanAndError, 3> channels;
};

// The mean over rays that fall on the cloth aslant.
Estimate mean_over_rays(std::uint64_t seed,
                        const std::function<glm::vec3(const Ray&, core::Random&)>& radiance,
                        int rays = kRays) {
  glm::dvec3 sum(0);
  glm::dvec3 squares(0);
  for (int i = 0; i < rays; ++i) {
    core::Random random(seed, 0, static_cast<std::uint64_t>(i));
    const double x = random.uniform_double();
    const double y = random.uniform_double();
    const glm::dvec3 one(radiance({{x, y, 5}, glm::normalize(glm::dvec3(0.3, -0.4, -1))}, random));
    sum += one;
    squares += one * one;
  }
  Estimate estimate;
  for (int c = 0; c < 3; ++c) {
    estimate.channels[static_cast<std::size_t>(c)] = core::mean_and_error(sum[c], squares[c], rays);
  }
  return estimate;
}

Estimate by_integrator(const Scene& scene, const PathSettings& settings, std::uint64_t seed,
                       int rays = kRays) {
  const PathIntegrator integrator(scene, settings);
  return mean_over_rays(
      seed,
      [&](const Ray& ray, core::Random& random) { return integrator.trace(ray, random).radiance; },
      rays);
}

void expect_equal(const Estimate& a, const Estimate& b) {
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_GT(a.channels[c].mean, 0);
    EXPECT_LT(std::fabs(a.channels[c].mean - b.channels[c].mean),
              kLimit * std::hypot(a.channels[c].standard_error, b.channels[c].standard_error))
        << c << ": " << a.channels[c].mean << " +- " << a.channels[c].standard_error << " against "
        << b.channels[c].mean << " +- " << b.channels[c].standard_error;
  }
}

class PathSamplingOf : public testing::TestWithParam<bool> {
 protected:
  [[nodiscard]] static shading::FibreMaterial material() { return GetParam() ? narrow() : broad(); }
};

TEST_P(PathSamplingOf, HasTheMeanOfPlainPaths) {
  std::uint64_t seed = 100;
  for (const std::vector<Light>& lights :
       {std::vector{sun()}, std::vector{sky()}, std::vector{lamp()},
        std::vector{bulb(), sky(), sun(), lamp()}}) {
    const Scene scene = scene_of(material(), lights);
    const Estimate plain = mean_over_rays(++seed, [&](const Ray& ray, core::Random& random) {
      return plain_radiance(scene, ray, random);
    });
    expect_equal(by_integrator(scene, {}, ++seed), plain);
  }
}

TEST_P(PathSamplingOf, OfNoMoreThanTwoScatteringsIsTheSameHoweverLightIsFound) {
  const Scene scene = scene_of(material(), {sky(), sun()});
  std::array<Estimate, 3> found;
  for (std::size_t k = 0; k < 3; ++k) {
    PathSettings settings;
    settings.max_scatterings = 2;
    settings.finding = static_cast<PathSettings::Finding>(k);
    found[k] = by_integrator(scene, settings, 200 + k);
  }
  expect_equal(found[0], found[1]);
  expect_equal(found[0], found[2]);
}

INSTANTIATE_TEST_SUITE_P(LobesBroadAndNarrow, PathSamplingOf, testing::Bool());

// Of hundreds of scatterings, after none of which a path's weight may grow: a sample's standard
// deviation is 3.7 to 4 means; it was 4.7 to 5.9 where long paths were ended by chance.
TEST(PathSampling, DeepBrightClothIsNotNoisy) {
  shading::FibreMaterial bright = broad();
  bright.c_r = {0.3f, 0.3f, 0.3f};
  bright.c_tt = {0.99f, 0.98f, 0.97f};
  const Scene scene = scene_of(bright, {sun()}, 60);
  const Estimate estimate = by_integrator(scene, {}, 400, 4000);
  for (const core::MeanAndError& channel : estimate.channels) {
    EXPECT_GT(channel.mean, 0.05);
    EXPECT_LT(channel.standard_error * std::sqrt(4000.0), 4.4 * channel.mean);
  }
}

}  // namespace
}  // namespace weft::render
