#include <cmath>

#include <gtest/gtest.h>

#include "core/random.h"
#include "transport/pca.h"

namespace weft::transport {
namespace {

// Images that are sums of `rank` known orthonormal patterns (cosines of the pixel number) with
// independent coefficients of standard deviation 0.2 2^-i:
// all within the clamp.
std::vector<float> known_images(int count, std::uint32_t pixels, int rank) {
  std::vector<float> images;
  for (int n = 0; n < count; ++n) {
    core::Random random(1, static_cast<std::uint32_t>(n));
    std::vector<float> image(pixels, 0.1f);
    for (int i = 0; i < rank; ++i) {
      const float c =
          (random.uniform() - 0.5f) * std::sqrt(12.0f) * 0.2f * std::exp2(-static_cast<float>(i));
      for (std::uint32_t p = 0; p < pixels; ++p) {
        const double angle = 3.14159265358979 * (i + 1) * (p + 0.5) / pixels;
        image[p] += c * static_cast<float>(std::sqrt(2.0 / pixels) * std::cos(angle));
      }
    }
    images.insert(images.end(), image.begin(), image.end());
  }
  return images;
}

TEST(TransportPca, Components_AreOrthonormalAndOfFallingVariance) {
  constexpr std::uint32_t kPixels = 128;
  auto images = known_images(300, kPixels, 8);
  const DistanceBasis basis = principal_components(images, kPixels, 6, 7);
  ASSERT_EQ(basis.variance.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double dot = 0;
      for (std::uint32_t p = 0; p < kPixels; ++p) {
        dot += static_cast<double>(basis.components[i * kPixels + p]) *
               static_cast<double>(basis.components[j * kPixels + p]);
      }
      EXPECT_NEAR(dot, i == j ? 1 : 0, 1e-5);
    }
    // Sample variances of the drawn coefficients: 4^-i within their spread.
    EXPECT_NEAR(basis.variance[i] * 25 * std::pow(4.0, static_cast<double>(i)), 1.0, 0.25);
  }
}

TEST(TransportPca, EnoughComponents_GiveTheImageBack) {
  constexpr std::uint32_t kPixels = 128;
  const auto originals = known_images(100, kPixels, 5);
  auto images = originals;
  const DistanceBasis basis = principal_components(images, kPixels, 5, 7);
  for (std::size_t n = 0; n < 100; n += 9) {
    const std::span<const float> image = std::span(originals).subspan(n * kPixels, kPixels);
    const auto back = reconstruct(basis, project(basis, image));
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      EXPECT_NEAR(back[p], image[p], 2e-5f);
    }
  }
}

TEST(TransportPca, MoreComponentsThanTheSampleSpans_AreZero) {
  auto images = known_images(5, 64, 3);
  const DistanceBasis basis = principal_components(images, 64, 12, 7);
  ASSERT_EQ(basis.components.size(), 12u * 64u);
  EXPECT_GT(basis.variance[2], 0.0f);
  for (std::size_t i = 5; i < 12; ++i) {
    EXPECT_EQ(basis.variance[i], 0.0f);
    EXPECT_EQ(basis.components[i * 64 + 3], 0.0f);
  }
  std::vector<float> none;
  const DistanceBasis empty = principal_components(none, 64, 4, 7);
  EXPECT_EQ(empty.mean, std::vector<float>(64, 0.0f));
}

TEST(TransportPca, SameSample_GivesTheSameBytes) {
  auto first = known_images(50, 64, 6);
  auto second = first;
  const auto a = principal_components(first, 64, 4, 3);
  const auto b = principal_components(second, 64, 4, 3);
  EXPECT_EQ(a.components, b.components);
  EXPECT_EQ(a.variance, b.variance);
}

}  // namespace
}  // namespace weft::transport
