#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/transport_images.h"
#include "tests/transport_tiles.h"
#include "transport/bake_point.h"
#include "transport/embree_scene.h"
#include "transport/signed_distance.h"
#include "transport/sphere.h"
#include "transport/visibility.h"
#include "transport/visibility_raster.h"
#include "transport/visibility_sg.h"

namespace weft::transport {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

using test::pixel_direction;
using test::random_image;

TEST(TransportSignedDistance, EqualsBruteForce) {
  constexpr std::uint32_t kResolution = 32;
  for (const int caps : {1, 3, 8}) {
    const auto bits = random_image(kResolution, caps, 5);
    const auto distances = signed_distance(bits, kResolution);
    for (std::uint32_t p = 0; p < kResolution * kResolution; ++p) {
      double nearest = 4;
      for (std::uint32_t q = 0; q < kResolution * kResolution; ++q) {
        if (is_visible(bits, p) != is_visible(bits, q)) {
          const glm::dvec3 a = pixel_direction(p, kResolution);
          const glm::dvec3 b = pixel_direction(q, kResolution);
          nearest = std::fmin(nearest, std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)));
        }
      }
      ASSERT_NEAR(distances[p], is_visible(bits, p) ? nearest : -nearest, 5e-6)
          << caps << " caps, pixel " << p;
    }
  }
}

TEST(TransportSignedDistance, Limit_ChangesNothingNearer) {
  constexpr std::uint32_t kResolution = 72;  // not a multiple of sixteen
  constexpr float kLimit = 0.3f;
  const auto bits = random_image(kResolution, 6, 11);
  const auto exact = signed_distance(bits, kResolution);
  std::vector<float> limited(exact.size());
  DistanceTransform(kResolution, kLimit).measure(bits, limited);
  std::size_t further = 0;
  for (std::size_t p = 0; p < exact.size(); ++p) {
    if (std::abs(exact[p]) < kLimit - 1e-6f) {
      ASSERT_EQ(limited[p], exact[p]) << p;
    } else {
      ASSERT_NEAR(limited[p], std::copysign(kLimit, exact[p]), 1e-6f) << p;
      ++further;
    }
  }
  EXPECT_GT(further, 100u);
  EXPECT_LT(further, exact.size() - 100);
}

TEST(TransportSignedDistance, WideAndPortablePaths_GiveTheSameBits) {
  for (const std::uint32_t resolution : {8u, 40u, 128u}) {
    for (const int caps : {1, 4, 20}) {
      const auto bits = random_image(resolution, caps, 17);
      const auto chosen = signed_distance(bits, resolution);
      setenv("WEFT_PORTABLE", "1", 1);
      const auto portable = signed_distance(bits, resolution);
      unsetenv("WEFT_PORTABLE");
      EXPECT_EQ(chosen, portable) << resolution << ", " << caps << " caps";
    }
  }
}

TEST(TransportSignedDistance, UniformImages_AreHalfATurnAway) {
  const std::vector<std::uint8_t> open(32, 0xff);
  const std::vector<std::uint8_t> blocked(32, 0x00);
  for (const float d : signed_distance(open, 16)) {
    EXPECT_EQ(d, kPi);
  }
  for (const float d : signed_distance(blocked, 16)) {
    EXPECT_EQ(d, -kPi);
  }
}

TEST(TransportSignedDistance, BiasCorrection_NeverTurnsASign) {
  const auto bits = random_image(64, 5, 9);
  auto distances = signed_distance(bits, 64);
  const auto before = distances;
  correct_pixel_bias(distances, 64);
  const float bias = 0.6f * kPi / 64;
  for (std::size_t p = 0; p < distances.size(); ++p) {
    EXPECT_EQ(distances[p] > 0, is_visible(bits, p));
    EXPECT_NEAR(std::abs(before[p]) - std::abs(distances[p]),
                std::fmin(bias, std::abs(before[p]) / 2), 1e-6f);
  }
}

TEST(TransportVisibility, HalfTheSky_IsHiddenByAPlaneOfTouchingFibres) {
  // Fibres side by side above a lower one: it sees nothing above, and below all but its lateral
  // copies' thin strips at the horizon.
  fabric::Tile tile = test::crossed_layers(1, 20, 0.026f, 4);
  test::add_strand(tile, {{0.5f, 0, -0.5f}, {0.5f, 0.5f, -0.5f}, {0.5f, 1, -0.5f}}, 0.01f, 0, 1);
  test::finish(tile);
  const Scene scene(tile);
  const std::uint32_t low = tile.segment_count() - 1;
  constexpr std::uint32_t kResolution = 32;
  const auto bits = visibility_bits(scene, low, kResolution);
  for (std::uint32_t p = 0; p < kResolution * kResolution; ++p) {
    const glm::dvec3 direction = pixel_direction(p, kResolution);
    if (direction.z > 0) {
      EXPECT_FALSE(is_visible(bits, p)) << p;
    }
    if (direction.z < -0.1) {
      EXPECT_TRUE(is_visible(bits, p)) << p;
    }
  }
  EXPECT_NEAR(open_share(bits, kResolution), 0.5, 0.05);
}

TEST(TransportVisibility, Bits_AreWhatRaysSay) {
  const fabric::Tile tile = test::random_hairs(300, 0.4f, 0.3f, 0.15f, 21);
  const Scene scene(tile);
  constexpr std::uint32_t kResolution = 64;
  std::uint32_t different = 0;
  std::uint32_t visible = 0;
  for (std::uint32_t k = 0; k < tile.segment_count(); k += 97) {
    const auto bits = visibility_bits(scene, k, kResolution);
    const auto [origin, own] = bake_point(scene, k);
    for (std::uint32_t p = 0; p < kResolution * kResolution; ++p) {
      const bool blocked = scene.occluded(origin, glm::vec3(pixel_direction(p, kResolution)),
                                          std::numeric_limits<float>::infinity(), own);
      different += is_visible(bits, p) == blocked ? 1 : 0;
      visible += blocked ? 0 : 1;
    }
  }
  EXPECT_GT(visible, 100u);
  EXPECT_LE(different, 1u);  // a ray that grazes a fibre within rounding
}

// Rays and the raster must see the same, but for rays that graze a fibre within rounding.
void compare_raster_with_rays(const fabric::Tile& tile, std::uint32_t step) {
  const Scene scene(tile);
  constexpr std::uint32_t kResolution = 64;
  const VisibilityRaster raster(scene, kResolution);
  std::uint32_t different = 0;
  std::uint32_t visible = 0;
  std::uint32_t pixels = 0;
  for (std::uint32_t k = 0; k < tile.segment_count(); k += step) {
    const auto by_rays = visibility_bits(scene, k, kResolution);
    const auto by_raster = raster.bits(k);
    ASSERT_EQ(by_rays.size(), by_raster.size());
    for (std::uint32_t p = 0; p < kResolution * kResolution; ++p, ++pixels) {
      different += is_visible(by_rays, p) != is_visible(by_raster, p) ? 1 : 0;
      visible += is_visible(by_rays, p) ? 1 : 0;
    }
  }
  EXPECT_GT(visible, pixels / 100);
  EXPECT_LT(visible, pixels - pixels / 100);
  EXPECT_LE(different, pixels / 50000);
}

TEST(TransportVisibilityRaster, SeesWhatRaysSeeInCrossedLayers) {
  compare_raster_with_rays(test::crossed_layers(4, 8, 0.02f, 6), 7);
}

TEST(TransportVisibilityRaster, SeesWhatRaysSeeInHairs) {
  compare_raster_with_rays(test::random_hairs(300, 0.4f, 0.3f, 0.15f, 21), 47);
}

TEST(TransportVisibilityRaster, SeesWhatRaysSeeInSparseCloth) {
  compare_raster_with_rays(test::random_hairs(40, 1.0f, 0.7f, 0.4f, 22), 17);
}

TEST(TransportVisibilityRaster, SeesWhatRaysSeeInATileSmallerThanItsFibres) {
  compare_raster_with_rays(test::random_hairs(8, 0.08f, 0.05f, 0.6f, 5), 3);
}

TEST(TransportVisibilityRaster, SeesWhatRaysSeeWhereSegmentsAreLong) {
  compare_raster_with_rays(test::crossed_layers(6, 5, 0.015f, 1), 2);
}

TEST(TransportVisibilityRaster, SeesWhatEmbreeSees) {
  constexpr std::uint32_t kResolution = 128;
  const fabric::Tile tile = test::random_hairs(300, 0.4f, 0.3f, 0.15f, 21);
  const Scene scene(tile);
  const EmbreeScene embree(tile);
  const VisibilityRaster raster(scene, kResolution);
  std::uint32_t different = 0;
  std::uint32_t visible = 0;
  for (std::uint32_t k = 0; k < tile.segment_count(); k += 97) {
    const auto by_rays = visibility_bits(scene, embree, k, kResolution);
    const auto by_raster = raster.bits(k);
    for (std::uint32_t p = 0; p < kResolution * kResolution; ++p) {
      different += is_visible(by_rays, p) != is_visible(by_raster, p) ? 1 : 0;
      visible += is_visible(by_rays, p) ? 1 : 0;
    }
  }
  EXPECT_GT(visible, 1000u);
  EXPECT_LE(different, 1u);  // a ray that grazes a fibre within rounding
}

TEST(TransportVisibilityRaster, WideAndPortablePaths_GiveTheSameBits) {
  for (const std::uint64_t seed : {31U, 32U, 33U}) {
    const fabric::Tile tile = test::random_hairs(120, 0.5f, 0.4f, 0.2f, seed);
    const Scene scene(tile);
    for (const std::uint32_t resolution : {40u, 128u}) {
      const VisibilityRaster raster(scene, resolution);
      for (std::uint32_t k = 0; k < tile.segment_count(); k += 29) {
        const auto chosen = raster.bits(k);
        setenv("WEFT_PORTABLE", "1", 1);
        const auto portable = raster.bits(k);
        unsetenv("WEFT_PORTABLE");
        ASSERT_EQ(chosen, portable) << "segment " << k << ", seed " << seed;
      }
    }
  }
}

TEST(TransportVisibilityRaster, AnyResolutionThatIsAMultipleOfEight_Works) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 6);
  const Scene scene(tile);
  for (const std::uint32_t resolution : {8u, 24u, 72u, 200u}) {
    const auto by_rays = visibility_bits(scene, 5, resolution);
    const auto by_raster = VisibilityRaster(scene, resolution).bits(5);
    std::uint32_t different = 0;
    for (std::uint32_t p = 0; p < resolution * resolution; ++p) {
      different += is_visible(by_rays, p) != is_visible(by_raster, p) ? 1 : 0;
    }
    EXPECT_LE(different, 1u) << resolution;
  }
}

TEST(TransportVisibilitySg, Weights_SumToTheVisibleHemisphere) {
  constexpr std::uint32_t kResolution = 64;
  const std::vector<std::uint8_t> open(kResolution * kResolution / 8, 0xff);
  const auto weights = SgRegions(48, kResolution).weights(open, sg_rotation(3, 17, kResolution));
  EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 2 * kPi, 1e-4);
  // Voronoi areas of the half-cell points lie within .55 to 1.31 of their mean.
  for (const float w : weights) {
    EXPECT_GT(w, 0.5f * 2 * kPi / 48);
    EXPECT_LT(w, 1.4f * 2 * kPi / 48);
  }
}

TEST(TransportVisibilitySg, Weights_GoToTheNearestAxis) {
  for (const std::uint32_t resolution : {24U, 32U, 136U}) {
    const SgRegions regions(12, resolution);
    for (std::uint32_t p = 0; p < resolution * resolution; p += 7) {
      const std::uint16_t rotation = sg_rotation(1, p, resolution);
      const auto axes = sg_axes(12, rotation);
      std::vector<std::uint8_t> bits(resolution * resolution / 8);
      bits[p / 8] = static_cast<std::uint8_t>(1U << (p % 8));
      const auto weights = regions.weights(bits, rotation);
      const glm::vec3 direction(pixel_direction(p, resolution));
      float nearest = -1;
      for (const glm::vec3& axis : axes) {
        nearest = std::max(nearest, glm::dot(axis, direction));
      }
      const double expected =
          p / resolution < resolution / 2 ? pixel_solid_angle(p / resolution, resolution) : 0;
      EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), expected, 1e-7);
      for (std::size_t q = 0; q < axes.size(); ++q) {
        // Where two axes are as near, rounding decides: the turn is rounded, too.
        EXPECT_TRUE(weights[q] == 0 || glm::dot(axes[q], direction) > nearest - 1e-4f) << p;
      }
    }
  }
}

TEST(TransportVisibilitySg, Weights_OfManyPixelsAreSums) {
  constexpr std::uint32_t kResolution = 32;
  const SgRegions regions(7, kResolution);
  const std::uint16_t rotation = sg_rotation(5, 6, kResolution);
  core::Random random(1, 2);
  std::vector<std::uint8_t> all(kResolution * kResolution / 8);
  std::vector<double> sum(7);
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<std::uint8_t> one(all.size());
    all[i] = one[i] = static_cast<std::uint8_t>(random.below(256));
    const auto weights = regions.weights(one, rotation);
    std::transform(weights.begin(), weights.end(), sum.begin(), sum.begin(), std::plus<>());
  }
  const auto weights = regions.weights(all, rotation);
  for (std::size_t q = 0; q < sum.size(); ++q) {
    EXPECT_NEAR(weights[q], sum[q], 1e-5);
  }
}

TEST(TransportVisibilitySg, Rotation_DependsOnSeedAndSegmentAlone) {
  EXPECT_EQ(sg_rotation(1, 2, 128), sg_rotation(1, 2, 128));
  EXPECT_NE(sg_rotation(1, 2, 128), sg_rotation(1, 3, 128));
  EXPECT_NE(sg_rotation(1, 2, 128), sg_rotation(2, 2, 128));
  const glm::vec3 still = sg_axes(48, 0)[7];
  const glm::vec3 quarter = sg_axes(48, 16384)[7];
  EXPECT_NEAR(quarter.x, -still.y, 1e-6f);
  EXPECT_NEAR(quarter.y, still.x, 1e-6f);
}

}  // namespace
}  // namespace weft::transport
