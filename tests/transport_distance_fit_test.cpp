#include <cmath>
#include <cstdlib>
#include <span>

#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/transport_images.h"
#include "transport/clamped_distance.h"
#include "transport/distance_fit.h"
#include "transport/normal_equations.h"
#include "transport/pca.h"
#include "transport/visibility.h"

namespace weft::transport {
namespace {

constexpr std::uint32_t kResolution = 32;
constexpr std::uint32_t kPixels = kResolution * kResolution;

std::vector<float> clamped_distances(std::span<const std::uint8_t> image,
                                     std::uint32_t resolution = kResolution) {
  std::vector<float> distances(std::size_t{resolution} * resolution);
  ClampedDistances(resolution).measure(image, distances);
  return distances;
}

DistanceBasis basis_of(std::uint64_t first, std::uint64_t count, std::uint32_t components,
                       std::uint32_t resolution = kResolution) {
  std::vector<float> sample;
  for (std::uint64_t i = first; i < first + count; ++i) {
    const auto image = clamped_distances(test::random_image(resolution, 2, i), resolution);
    sample.insert(sample.end(), image.begin(), image.end());
  }
  return principal_components(sample, resolution * resolution, components, 7);
}

std::vector<std::uint8_t> some_images(std::uint64_t first, std::uint64_t count,
                                      std::uint32_t resolution = kResolution) {
  std::vector<std::uint8_t> images;
  for (std::uint64_t i = first; i < first + count; ++i) {
    const auto image = test::random_image(resolution, 2, i);
    images.insert(images.end(), image.begin(), image.end());
  }
  return images;
}

TEST(TransportDistanceFit, OfImagesNotInTheSample_TurnsFewerSignsThanTheProjection) {
  const DistanceBasis basis = basis_of(100, 150, 24);
  const auto images = some_images(1000, 30);
  std::vector<float> projected;
  for (std::size_t i = 0; i < 30; ++i) {
    const auto c =
        project(basis, clamped_distances(std::span(images).subspan(i * kPixels / 8, kPixels / 8)));
    projected.insert(projected.end(), c.begin(), c.end());
  }
  const auto fitted = DistanceFit(basis, kResolution).coefficients(images);
  ASSERT_EQ(fitted.size(), 30u * 24u);
  const std::uint64_t wrong = wrong_signs(basis, images, fitted);
  EXPECT_GT(wrong, 0u);
  EXPECT_LT(10 * wrong, 9 * wrong_signs(basis, images, projected));
}

TEST(TransportDistanceFit, OfAnImageThatTheComponentsSpan_TurnsNoSign) {
  const DistanceBasis basis = basis_of(1, 10, 16);
  const auto images = some_images(1, 10);
  EXPECT_LE(wrong_signs(basis, images, DistanceFit(basis, kResolution).coefficients(images)), 2u);
}

TEST(TransportDistanceFit, WideAndPortablePaths_GiveTheSameBytes) {
  for (const std::uint32_t resolution : {40u, 128u}) {
    for (const std::uint32_t components : {5u, 48u, 70u}) {
      const DistanceBasis basis = basis_of(100, 20, components, resolution);
      const auto images = some_images(200, 3, resolution);
      const auto chosen = DistanceFit(basis, resolution).coefficients(images);
      setenv("WEFT_PORTABLE", "1", 1);
      const auto portable = DistanceFit(basis, resolution).coefficients(images);
      unsetenv("WEFT_PORTABLE");
      EXPECT_EQ(chosen, portable) << resolution << ", " << components << " components";
    }
  }
}

TEST(TransportDistanceFit, OfSeveralImages_IsThatOfEach) {
  const DistanceBasis basis = basis_of(100, 30, 12);
  const DistanceFit fit(basis, kResolution);
  const auto images = some_images(300, 3);
  std::vector<float> each;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto c = fit.coefficients(std::span(images).subspan(i * kPixels / 8, kPixels / 8));
    each.insert(each.end(), c.begin(), c.end());
  }
  EXPECT_EQ(fit.coefficients(images), each);
  EXPECT_TRUE(fit.coefficients({}).empty());
}

TEST(TransportDistanceFit, WrongSigns_AreThoseOfTheReconstruction) {
  const DistanceBasis basis = basis_of(100, 30, 6);
  const auto images = some_images(400, 11);
  const auto coefficients = DistanceFit(basis, kResolution).coefficients(images);
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < 11; ++i) {
    const auto decoded = reconstruct(basis, std::span(coefficients).subspan(i * 6, 6));
    const auto image = std::span(images).subspan(i * kPixels / 8, kPixels / 8);
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      wrong += (decoded[p] > 0) != is_visible(image, p) ? 1 : 0;
    }
  }
  EXPECT_GT(wrong, 20u);
  EXPECT_NEAR(static_cast<double>(wrong_signs(basis, images, coefficients)),
              static_cast<double>(wrong), 1);  // a value that rounding takes over zero
}

TEST(TransportNormalEquations, Solution_LeavesNoGradient) {
  constexpr std::size_t kRows = 300;
  constexpr std::size_t kWidth = 32;
  constexpr std::size_t kUnknowns = 27;
  core::Random random(9, 0);
  std::vector<float> a(kRows * kWidth);
  std::vector<float> b(kRows);
  for (std::size_t i = 0; i < kRows; ++i) {
    for (std::size_t j = 0; j < kUnknowns; ++j) {
      a[i * kWidth + j] = random.uniform() - 0.5f;
    }
    b[i] = random.uniform();
  }
  std::vector<float> matrix(kWidth * kWidth);
  std::vector<float> vector(kWidth);
  form_normal_equations(a, b, kRows, false, matrix, vector);
  std::vector<double> x(vector.begin(), vector.begin() + kUnknowns);
  constexpr double kRidge = 0.25;
  solve_normal_equations(matrix, kWidth, kRidge, x);
  for (std::size_t j = 0; j < kUnknowns; ++j) {
    double gradient = kRidge * x[j];
    for (std::size_t i = 0; i < kRows; ++i) {
      double residual = -static_cast<double>(b[i]);
      for (std::size_t k = 0; k < kUnknowns; ++k) {
        residual += static_cast<double>(a[i * kWidth + k]) * x[k];
      }
      gradient += static_cast<double>(a[i * kWidth + j]) * residual;
    }
    EXPECT_NEAR(gradient, 0, 1e-4) << j;
  }
}

}  // namespace
}  // namespace weft::transport
