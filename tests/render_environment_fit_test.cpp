#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/digest.h"
#include "core/file.h"
#include "core/random.h"
#include "render/environment_cache.h"
#include "render/nonnegative_least_squares.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

constexpr std::uint32_t kWidth = 256;
constexpr std::uint32_t kHeight = 128;

glm::dvec3 direction_of_pixel(std::uint32_t x, std::uint32_t y) {
  const double azimuth = 2 * kPi * ((x + 0.5) / kWidth - 0.5);
  const double theta = kPi * (y + 0.5) / kHeight;
  return {std::sin(theta) * std::sin(azimuth), std::sin(theta) * std::cos(azimuth),
          std::cos(theta)};
}

Image picture_of(const std::vector<SgLight>& lights) {
  Image picture(kWidth, kHeight);
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      for (const SgLight& light : lights) {
        picture.at(x, y) +=
            light.irradiance *
            static_cast<float>(pdf_sg(light.towards, light.sharpness, direction_of_pixel(x, y)));
      }
    }
  }
  return picture;
}

EnvironmentLight light_of(const Image& picture, double turn = 0, bool cut = false) {
  return {std::make_shared<Environment>(picture, glm::vec3(1), turn), cut};
}

// Light from everywhere: the picture's pixels, and what the lights hold.
glm::dvec3 energy_of(const Image& picture) {
  glm::dvec3 energy(0);
  for (std::uint32_t y = 0; y < picture.height; ++y) {
    const double part =
        2 * kPi / picture.width *
        (std::cos(kPi * y / picture.height) - std::cos(kPi * (y + 1) / picture.height));
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      energy += part * glm::dvec3(picture.at(x, y));
    }
  }
  return energy;
}
glm::dvec3 energy_of(const EnvironmentFit& fit) {
  glm::dvec3 energy(0);
  for (const SgLight& light : fit.lights) {
    energy += glm::dvec3(light.irradiance);
  }
  return energy;
}

// A random sky: a gradient, noise, and a small sun.
Image sky() {
  Image picture(64, 32);
  core::Random random(5, 0);
  for (std::uint32_t y = 0; y < picture.height; ++y) {
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      const float height = 1 - static_cast<float>(y) / 32;
      picture.at(x, y) = glm::vec3(0.2f + 0.3f * height, 0.3f + 0.4f * height, 0.4f + height) *
                         (0.5f + random.uniform());
    }
  }
  picture.at(40, 7) = glm::vec3(400, 350, 300);
  return picture;
}

TEST(EnvironmentFit, ASumOfGaussiansIsRecovered) {
  const std::vector<SgLight> lights = {
      {glm::normalize(glm::dvec3(0.5, 0.4, 0.7)), 60, {3, 2, 1}, false},
      {glm::normalize(glm::dvec3(-0.6, 0.2, 0.3)), 12, {1, 2, 3}, false},
      {glm::normalize(glm::dvec3(0.1, -0.8, -0.4)), 25, {0, 1.5f, 0.5f}, false}};
  const EnvironmentFit fit = fit_environment(light_of(picture_of(lights)), {8, false});
  EXPECT_LT(fit.relative_error, 0.01);
  for (const SgLight& light : lights) {
    glm::dvec3 found(0);  // what the fit holds about the light
    double nearest = -1;
    for (const SgLight& one : fit.lights) {
      if (glm::dot(one.towards, light.towards) > std::cos(0.1)) {
        found += glm::dvec3(one.irradiance);
        nearest = std::max(nearest, glm::dot(one.towards, light.towards));
      }
    }
    EXPECT_GT(nearest, std::cos(0.02)) << "sharpness " << light.sharpness;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(found[c], light.irradiance[c], 0.03 * 3) << "sharpness " << light.sharpness;
    }
  }
}

TEST(EnvironmentFit, AConstantMapGivesOneUniformLight) {
  Image picture(32, 16);
  for (glm::vec3& pixel : picture.pixels) {
    pixel = {0.5f, 1.0f, 2.0f};
  }
  for (const bool upper_half : {false, true}) {
    const EnvironmentFit fit = fit_environment(light_of(picture), {16, upper_half});
    ASSERT_EQ(fit.lights.size(), 1U);
    EXPECT_EQ(fit.lights[0].cut_at_horizon, upper_half);
    EXPECT_LT(fit.relative_error, 1e-3);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(fit.lights[0].irradiance[c], 4 * kPi * picture.pixels[0][c],
                  1e-3 * 4 * kPi * picture.pixels[0][c]);
    }
    EXPECT_LT(fit.lights[0].sharpness, 1e-3);
  }
}

TEST(EnvironmentFit, EnergyIsKeptInEveryChannelAndNoAmplitudeIsNegative) {
  const Image picture = sky();
  for (const std::uint32_t most : {1U, 4U, 12U}) {
    const EnvironmentFit fit = fit_environment(light_of(picture), {most, false});
    EXPECT_LE(fit.lights.size(), most);
    const glm::dvec3 expected = energy_of(picture);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(energy_of(fit)[c], expected[c], 2e-3 * expected[c]);
    }
    for (const SgLight& light : fit.lights) {
      EXPECT_GE(std::min({light.irradiance.x, light.irradiance.y, light.irradiance.z}), 0);
    }
  }
}

TEST(EnvironmentFit, MoreLightsFitBetterAndTheIrradianceIsClose) {
  const Image picture = sky();
  const EnvironmentFit few = fit_environment(light_of(picture), {2, false});
  const EnvironmentFit many = fit_environment(light_of(picture), {12, false});
  EXPECT_LT(many.relative_error, few.relative_error);
  EXPECT_LT(many.irradiance_error, 0.01);
  // Reported as it is: irradiance on planes, from the lights and from the picture themselves.
  for (const glm::dvec3& normal :
       {glm::dvec3(0, 0, 1), glm::normalize(glm::dvec3(1, 2, -1)), glm::dvec3(-1, 0, 0)}) {
    const auto irradiance = [&](const Light& light) {
      double sum = 0;
      constexpr int kSteps = 40000;
      for (int i = 0; i < kSteps; ++i) {
        core::Random random(6, 0, static_cast<std::uint64_t>(i));
        const LightSample sample =
            sample_light(light, glm::dvec3(0), random.uniform_double(), random.uniform_double());
        sum += static_cast<double>(sample.radiance.y) / sample.pdf *
               std::max(0.0, glm::dot(normal, sample.direction)) / kSteps;
      }
      return sum;
    };
    double fitted = 0;
    for (const SgLight& light : many.lights) {
      fitted += irradiance(light);
    }
    EXPECT_NEAR(fitted, irradiance(light_of(picture)), 0.03 * fitted);
  }
}

TEST(EnvironmentFit, ATurnedEnvironmentGivesTurnedLights) {
  const std::vector<SgLight> lights = {{glm::normalize(glm::dvec3(0, 1, 0.5)), 40, {1, 1, 1}}};
  const double turn = 0.7;
  const EnvironmentFit fit = fit_environment(light_of(picture_of(lights), turn), {1, false});
  ASSERT_EQ(fit.lights.size(), 1U);
  const EnvironmentLight turned_light = light_of(picture_of(lights), turn);
  const glm::vec3 there = turned_light.environment->radiance(fit.lights[0].towards);
  EXPECT_NEAR(there.x, 1 / sg_mass(40), 0.02 / sg_mass(40));
}

TEST(EnvironmentFit, WhatIsBelowTheHorizonDoesNotCountWhenItIsCut) {
  Image picture(32, 16);
  for (std::uint32_t y = 8; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 32; ++x) {
      picture.at(x, y) = glm::vec3(100);
    }
  }
  picture.at(4, 3) = glm::vec3(1);
  const EnvironmentFit fit = fit_environment(light_of(picture, 0, true), {6, false});
  double above = 0;
  for (const SgLight& light : fit.lights) {
    EXPECT_TRUE(light.cut_at_horizon);
    above += static_cast<double>(light.irradiance.x);
  }
  EXPECT_GT(above, 0);
}

class CacheFolder {
 public:
  CacheFolder()
      : path_(std::filesystem::temp_directory_path() /
              ("weft-fits-" + std::to_string(reinterpret_cast<std::uintptr_t>(this)))) {
    std::filesystem::remove_all(path_);
  }
  ~CacheFolder() { std::filesystem::remove_all(path_); }
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void expect_equal(const EnvironmentFit& a, const EnvironmentFit& b) {
  EXPECT_EQ(a.relative_error, b.relative_error);
  EXPECT_EQ(a.irradiance_error, b.irradiance_error);
  ASSERT_EQ(a.lights.size(), b.lights.size());
  for (std::size_t i = 0; i < a.lights.size(); ++i) {
    EXPECT_EQ(a.lights[i].towards, b.lights[i].towards);
    EXPECT_EQ(a.lights[i].sharpness, b.lights[i].sharpness);
    EXPECT_EQ(a.lights[i].irradiance, b.lights[i].irradiance);
    EXPECT_EQ(a.lights[i].cut_at_horizon, b.lights[i].cut_at_horizon);
  }
}

TEST(EnvironmentCache, AFitIsKeptFoundAgainAndMadeAgainWhenDamaged) {
  const CacheFolder folder;
  const EnvironmentFitSettings settings{3, false};
  const EnvironmentFit fresh = cached_environment_fit(light_of(sky()), settings, folder.path());
  expect_equal(fresh, fit_environment(light_of(sky()), settings));
  std::vector<std::filesystem::path> entries;
  for (const auto& item : std::filesystem::directory_iterator(folder.path())) {
    entries.push_back(item.path());
  }
  ASSERT_EQ(entries.size(), 1U);
  const std::string kept = core::read_file(entries[0]);
  expect_equal(cached_environment_fit(light_of(sky()), settings, folder.path()), fresh);
  // It was read, not made again: another content with its seal is believed.
  const std::string other = "0.5 0.25\n";
  std::ofstream(entries[0], std::ios::trunc) << other << core::digest_of(other).hex() << "\n";
  EXPECT_EQ(cached_environment_fit(light_of(sky()), settings, folder.path()).relative_error, 0.5);
  std::ofstream(entries[0], std::ios::trunc) << kept;
  // Turned, it is the same entry.
  const EnvironmentFit aside =
      cached_environment_fit(light_of(sky(), 0.5), settings, folder.path());
  expect_equal(aside, turned(fresh, 0.5));
  // Damage is found and mended.
  for (std::size_t cut : {std::size_t{0}, std::size_t{10}, kept.size() - 1}) {
    std::ofstream(entries[0], std::ios::trunc) << kept.substr(0, cut);
    expect_equal(cached_environment_fit(light_of(sky()), settings, folder.path()), fresh);
    EXPECT_EQ(core::read_file(entries[0]), kept);
  }
  // Other settings are another entry.
  (void)cached_environment_fit(light_of(sky()), {2, false}, folder.path());
  (void)cached_environment_fit(light_of(sky()), {3, true}, folder.path());
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()),
                          std::filesystem::directory_iterator()),
            3);
}

TEST(EnvironmentCache, TheLightsOfASceneThatComeFromEverywhereBecomeGaussians) {
  Scene scene;
  scene.lights = {DirectionalLight{{0, 0, 1}, {1, 1, 1}}, light_of(sky()),
                  UniformLight{{1, 2, 3}, true}};
  fit_environments(scene, {4, false}, {});
  ASSERT_GE(scene.lights.size(), 3U);
  EXPECT_TRUE(std::holds_alternative<DirectionalLight>(scene.lights.front()));
  for (std::size_t i = 1; i < scene.lights.size(); ++i) {
    EXPECT_TRUE(std::holds_alternative<SgLight>(scene.lights[i]));
  }
  EXPECT_EQ(scene.remarks.size(), 1U);
  // The uniform one sends the same radiance along every ray.
  for (const glm::dvec3& towards : {glm::dvec3(0, 0, 1), glm::normalize(glm::dvec3(1, 1, 0.1))}) {
    const auto met = emission(scene.lights.back(), {glm::dvec3(0), towards});
    ASSERT_TRUE(met);
    EXPECT_NEAR(met->radiance.y, 2, 1e-3);
  }
}

TEST(EnvironmentFit, APictureFromOutsideIsFittedWell) {
  const char* shared = std::getenv("WEFT_SHARED_DATA");
  if (shared == nullptr) {
    GTEST_SKIP() << "WEFT_SHARED_DATA is not set: no environment picture to fit";
  }
  const Image picture =
      read_exr(std::filesystem::path(shared) / "envmaps" / "thunderloom_envmap.exr");
  const EnvironmentFit fit = fit_environment(light_of(picture), {32, false});
  EXPECT_LT(fit.irradiance_error, 0.02);
  EXPECT_LT(fit.relative_error, 0.3);
}

TEST(NonnegativeLeastSquares, SolutionsAreThoseOfTheConditionsOfKuhnAndTucker) {
  constexpr std::size_t kRows = 12;
  constexpr std::size_t kColumns = 7;
  int bound = 0;
  for (std::uint32_t trial = 0; trial < 50; ++trial) {
    core::Random random(8, trial);
    std::vector<double> a(kRows * kColumns);
    std::vector<double> b(kRows);
    for (double& value : a) {
      value = random.uniform_double() - 0.3;
    }
    for (double& value : b) {
      value = random.uniform_double() - 0.4;
    }
    std::vector<double> gram(kColumns * kColumns, 0.0);
    std::vector<double> projected(kColumns, 0.0);
    for (std::size_t r = 0; r < kRows; ++r) {
      for (std::size_t i = 0; i < kColumns; ++i) {
        projected[i] += a[r * kColumns + i] * b[r];
        for (std::size_t j = 0; j < kColumns; ++j) {
          gram[i * kColumns + j] += a[r * kColumns + i] * a[r * kColumns + j];
        }
      }
    }
    const std::vector<double> x = nonnegative_least_squares(gram, projected);
    for (std::size_t i = 0; i < kColumns; ++i) {
      double gradient = projected[i];
      for (std::size_t j = 0; j < kColumns; ++j) {
        gradient -= gram[i * kColumns + j] * x[j];
      }
      EXPECT_GE(x[i], 0);
      EXPECT_LT(gradient, 1e-8);
      EXPECT_LT(std::fabs(gradient * x[i]), 1e-8);
      bound += x[i] == 0 ? 1 : 0;
    }
  }
  EXPECT_GT(bound, 20);
  // Equal columns share or one gets all; nothing breaks.
  const std::vector<double> twins = nonnegative_least_squares({{1.0, 1.0, 1.0, 1.0}}, {{2.0, 2.0}});
  EXPECT_NEAR(twins[0] + twins[1], 2, 1e-6);
}

}  // namespace
}  // namespace weft::render
