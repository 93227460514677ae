#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "render/similarity.h"

namespace weft::render {
namespace {

// Waves of a few pixels.
Image waves(float contrast) {
  Image image(48, 40);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (std::uint32_t x = 0; x < image.width; ++x) {
      const auto phase = 0.7f * static_cast<float>(x) + 0.3f * static_cast<float>(y);
      image.at(x, y) = glm::vec3(0.25f + contrast * std::sin(phase));
    }
  }
  return image;
}

TEST(Similarity, IsOneForEqualPicturesAndFallsWithNoise) {
  const Image reference = waves(0.2f);
  EXPECT_NEAR(structural_similarity(reference, reference), 1, 1e-12);
  double before = 1;
  for (const float noise : {0.02f, 0.08f, 0.3f}) {
    Image noisy = reference;
    core::Random random(1, 2);
    for (glm::vec3& pixel : noisy.pixels) {
      pixel += glm::vec3(noise * (random.uniform() - 0.5f));
    }
    const double found = structural_similarity(noisy, reference);
    EXPECT_LT(found, before);
    before = found;
  }
  EXPECT_LT(before, 0.95);
}

TEST(Similarity, OfFlatPicturesIsTheirLuminanceTerm) {
  // Without structure only (2 a b + C1) / (a^2 + b^2 + C1) is left, of the displayed values.
  Image bright(16, 16);
  Image dark(16, 16);
  for (std::size_t i = 0; i < bright.pixels.size(); ++i) {
    bright.pixels[i] = glm::vec3(0.25f);
    dark.pixels[i] = glm::vec3(0.0625f);
  }
  const auto shown = [](double v) {
    return std::round(255 * (1.055 * std::pow(v, 1 / 2.4) - 0.055));
  };
  const double a = shown(0.0625);
  const double b = shown(0.25);
  const double c1 = 6.5025;
  EXPECT_NEAR(structural_similarity(dark, bright), (2 * a * b + c1) / (a * a + b * b + c1), 1e-6);
}

TEST(Similarity, OppositeWavesAreUnlike) {
  EXPECT_LT(structural_similarity(waves(-0.2f), waves(0.2f)), 0);
}

TEST(Similarity, RefusesPicturesOfDifferentSizes) {
  EXPECT_THROW((void)structural_similarity(Image(4, 5), Image(5, 4)), core::Error);
}

}  // namespace
}  // namespace weft::render
