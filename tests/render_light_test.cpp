#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "render/light.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

constexpr int kRows = 12;
constexpr int kColumns = 24;
constexpr int kSamples = 60000;
const glm::dvec3 kPoint{0.2, -0.1, 0.05};

Image picture() {
  Image image(16, 8);
  core::Random random(2, 0);
  for (glm::vec3& pixel : image.pixels) {
    pixel = glm::vec3(random.uniform(), random.uniform(), random.uniform());
  }
  image.at(5, 2) = glm::vec3(40);
  image.at(7, 4) = glm::vec3(0);
  return image;
}

std::vector<Light> finite_lights() {
  return {SgLight{glm::normalize(glm::dvec3(0.4, -0.2, 0.7)), 3, {1, 1, 1}},
          SgLight{glm::dvec3(0, 0, -1), 60, {1, 1, 1}},
          RectangleLight{{-2, -1, 1}, {0, 3, 0}, {2.5, 0, 0.5}, {1, 1, 1}},
          DiscLight{{1, 0.5, 1}, glm::normalize(glm::dvec3(-0.6, -0.3, -1)), 1.1, {1, 1, 1}},
          UniformLight{{1, 1, 1}, false},
          UniformLight{{1, 1, 1}, true},
          EnvironmentLight{std::make_shared<Environment>(picture(), glm::vec3(1), 0.3), false}};
}

int bin_of(const glm::dvec3& direction) {
  const double u = 0.5 + std::atan2(direction.y, direction.x) / (2 * kPi);
  const int row = std::min(kRows - 1, static_cast<int>((1 - direction.z) / 2 * kRows));
  const int column = std::min(kColumns - 1, static_cast<int>(u * kColumns));
  return row * kColumns + column;
}

// Probability of each bin by the density that emission() states, integrated numerically.
std::vector<double> expected_shares(const Light& light) {
  constexpr int kFine = 60;
  std::vector<double> shares(kRows * kColumns, 0.0);
  const double cell = 4 * kPi / (kRows * kColumns * kFine * kFine);
  for (int row = 0; row < kRows * kFine; ++row) {
    for (int column = 0; column < kColumns * kFine; ++column) {
      const double z = 1 - 2 * (row + 0.5) / (kRows * kFine);
      const double phi = 2 * kPi * ((column + 0.5) / (kColumns * kFine) - 0.5);
      const auto met = emission(light, {kPoint, direction_of(z, phi)});
      if (met) {
        shares[static_cast<std::size_t>((row / kFine) * kColumns + column / kFine)] +=
            met->pdf * cell;
      }
    }
  }
  return shares;
}

TEST(Light, SamplesFollowTheirDensity) {
  // Chi-square over bins on the sphere, significance 0.01 over all lights together (Sidak): with
  // Wilson and Hilferty's normal approximation 3.19 standard deviations for seven tests.
  for (const Light& light : finite_lights()) {
    const std::vector<double> shares = expected_shares(light);
    std::vector<double> counts(shares.size(), 0.0);
    for (std::uint64_t i = 0; i < kSamples; ++i) {
      core::Random random(4, static_cast<std::uint32_t>(light.index()), i);
      const double u1 = random.uniform_double();
      const double u2 = random.uniform_double();
      const LightSample sample = sample_light(light, kPoint, u1, u2);
      ASSERT_NEAR(glm::length(sample.direction), 1, 1e-9);
      counts[static_cast<std::size_t>(bin_of(sample.direction))] += 1;
    }
    double chi_square = 0;
    int degrees = -1;
    double pooled_expected = 0;
    double pooled = 0;
    double total = 0;
    for (std::size_t b = 0; b < shares.size(); ++b) {
      total += shares[b];
      const double expected = shares[b] * kSamples;
      if (expected < 20) {
        pooled_expected += expected;
        pooled += counts[b];
        continue;
      }
      chi_square += (counts[b] - expected) * (counts[b] - expected) / expected;
      ++degrees;
    }
    if (pooled_expected >= 5) {
      chi_square += (pooled - pooled_expected) * (pooled - pooled_expected) / pooled_expected;
      ++degrees;
    }
    EXPECT_NEAR(total, 1, 3e-3) << "light " << light.index();
    ASSERT_GT(degrees, 3);
    const double scale = 2.0 / (9 * degrees);
    const double score = (std::cbrt(chi_square / degrees) - (1 - scale)) / std::sqrt(scale);
    EXPECT_LT(score, 3.19) << "light " << light.index() << " chi-square " << chi_square << " of "
                           << degrees;
  }
}

TEST(Light, SampledAndMetRadianceAndDensityAgree) {
  for (const Light& light : finite_lights()) {
    int checked = 0;
    for (std::uint64_t i = 0; i < 500; ++i) {
      core::Random random(5, 0, i);
      const double u1 = random.uniform_double();
      const double u2 = random.uniform_double();
      const LightSample sample = sample_light(light, kPoint, u1, u2);
      const auto met = emission(light, {kPoint, sample.direction});
      if (sample.radiance == glm::vec3(0) || !met) {
        continue;
      }
      ++checked;
      EXPECT_NEAR(met->pdf, sample.pdf, 1e-6 * sample.pdf);
      EXPECT_NEAR(met->radiance.x, sample.radiance.x, 1e-5f * sample.radiance.x);
      if (sample.distance_mm < kInfinity) {
        EXPECT_NEAR(met->distance_mm, sample.distance_mm, 1e-9 * sample.distance_mm);
      }
    }
    EXPECT_GT(checked, 450) << "light " << light.index();
  }
}

TEST(Light, ASphericalGaussianGivesItsIrradianceWhateverItsSharpness) {
  for (const double sharpness : {1e-9, 0.5, 10.0, 1000.0, 100000.0}) {
    const Light light = SgLight{{0, 0, 1}, sharpness, {2, 2, 2}};
    double sum = 0;
    for (std::uint64_t i = 0; i < 1000; ++i) {
      core::Random random(6, 0, i);
      const double u1 = random.uniform_double();
      const double u2 = random.uniform_double();
      const LightSample sample = sample_light(light, kPoint, u1, u2);
      sum += static_cast<double>(sample.radiance.x) / sample.pdf;
    }
    EXPECT_NEAR(sum / 1000, 2, 1e-5);
  }
}

TEST(Light, AnEnvironmentPictureHasItsTopUpAndItsMiddleTowardsY) {
  Image image(8, 4);
  image.at(3, 0) = {1, 0, 0};  // near the top
  image.at(4, 1) = {0, 1, 0};  // just right of the middle, above the horizon
  image.at(6, 2) = {0, 0, 1};  // farther to the right, below
  const Environment environment(image, glm::vec3(2), 0);
  EXPECT_EQ(environment.radiance(glm::normalize(glm::dvec3(0.2, 1, 0.4))), glm::vec3(0, 2, 0));
  EXPECT_EQ(environment.radiance(glm::normalize(glm::dvec3(1, -0.1, -0.3))), glm::vec3(0, 0, 2));
  EXPECT_EQ(environment.radiance(glm::normalize(glm::dvec3(-0.1, 0.2, 1))), glm::vec3(2, 0, 0));
  // A quarter turn to the left, seen from above.
  const Environment turned(image, glm::vec3(2), kPi / 2);
  EXPECT_EQ(turned.radiance(glm::normalize(glm::dvec3(-1, 0.2, 0.4))), glm::vec3(0, 2, 0));
  EXPECT_THROW(Environment(Image(4, 2), glm::vec3(1), 0), core::Error);
}

TEST(Light, NothingComesFromBelowAHorizonThatCuts) {
  const std::vector<Light> lights = {
      SgLight{{0, 0, 1}, 0.5, {1, 1, 1}, true}, UniformLight{{1, 1, 1}, true},
      EnvironmentLight{std::make_shared<Environment>(picture(), glm::vec3(1), 0), true}};
  for (const Light& light : lights) {
    EXPECT_FALSE(emission(light, {kPoint, glm::normalize(glm::dvec3(1, 0, -0.01))}).has_value());
    for (std::uint64_t i = 0; i < 300; ++i) {
      core::Random random(7, 0, i);
      const double u1 = random.uniform_double();
      const double u2 = random.uniform_double();
      const LightSample sample = sample_light(light, kPoint, u1, u2);
      EXPECT_TRUE(sample.direction.z >= 0 || sample.radiance == glm::vec3(0));
    }
  }
}

}  // namespace
}  // namespace weft::render
