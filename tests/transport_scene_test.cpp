#include <algorithm>
#include <limits>
#include <optional>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>
#include <xmmintrin.h>

#include "core/error.h"
#include "core/random.h"
#include "tests/transport_tiles.h"
#include "transport/scene.h"

namespace weft::transport {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

struct Overlap {
  double enter;
  double leave;
};

// Where the line o + t d (unit d) runs inside a capsule: the union over the cylinder between the
// end planes and the two end balls, in double precision; analytic, no hierarchy.
std::optional<Overlap> line_in_capsule(glm::dvec3 o, glm::dvec3 d, const fabric::Segment& s,
                                       glm::dvec3 offset) {
  const glm::dvec3 a = glm::dvec3(s.a_mm) + offset;
  const glm::dvec3 b = glm::dvec3(s.b_mm) + offset;
  const double r = s.radius_mm;
  std::optional<Overlap> found;
  const auto unite = [&](double enter, double leave) {
    found = found ? Overlap{std::min(found->enter, enter), std::max(found->leave, leave)}
                  : Overlap{enter, leave};
  };
  for (const glm::dvec3& centre : {a, b}) {
    const double middle = glm::dot(centre - o, d);
    const double h2 = r * r - glm::dot(centre - o - middle * d, centre - o - middle * d);
    if (h2 > 0) {
      unite(middle - std::sqrt(h2), middle + std::sqrt(h2));
    }
  }
  const double length = glm::length(b - a);
  if (length > 0) {
    const glm::dvec3 u = (b - a) / length;
    const glm::dvec3 d_across = d - glm::dot(d, u) * u;
    const glm::dvec3 o_across = (o - a) - glm::dot(o - a, u) * u;
    const double qa = glm::dot(d_across, d_across);
    const double qb = glm::dot(d_across, o_across);
    const double root = qb * qb - qa * (glm::dot(o_across, o_across) - r * r);
    if (qa > 1e-18 && root > 0) {
      double enter = (-qb - std::sqrt(root)) / qa;
      double leave = (-qb + std::sqrt(root)) / qa;
      const double along = glm::dot(d, u);
      const double at = glm::dot(o - a, u);
      if (std::abs(along) > 1e-12) {
        const double t0 = -at / along;
        const double t1 = (length - at) / along;
        enter = std::max(enter, std::min(t0, t1));
        leave = std::min(leave, std::max(t0, t1));
      } else if (at < 0 || at > length) {
        leave = enter;
      }
      if (enter < leave) {
        unite(enter, leave);
      }
    }
  }
  return found;
}

struct BruteForce {
  double closest_entry = std::numeric_limits<double>::infinity();
  std::uint32_t segment = 0;
  bool overlaps = false;
};

// Every segment in every copy of the tile within `reach` tiles, points where the tile has them.
BruteForce brute_force(const Scene& scene, glm::vec3 origin, glm::vec3 direction, double t_max,
                       const std::optional<StrandCopy>& ignored, int reach) {
  const fabric::Tile& tile = scene.tile();
  const glm::ivec2 own = scene.tile_of(origin);
  BruteForce result;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    for (int x = -reach; x <= reach; ++x) {
      for (int y = -reach; y <= reach; ++y) {
        const StrandCopy copy =
            scene.seen_from({tile.segment_strand[k], own.x + x, own.y + y}, own);
        if (ignored && copy == *ignored) {
          continue;
        }
        const auto overlap = line_in_capsule(
            origin, direction, tile.segment(k),
            {static_cast<double>(own.x + x) * static_cast<double>(tile.size_mm.x),
             static_cast<double>(own.y + y) * static_cast<double>(tile.size_mm.y), 0.0});
        if (!overlap) {
          continue;
        }
        result.overlaps |= overlap->leave > 0 && overlap->enter < t_max;
        if (overlap->enter > 0 && overlap->enter < t_max && overlap->enter < result.closest_entry) {
          result.closest_entry = overlap->enter;
          result.segment = k;
        }
      }
    }
  }
  return result;
}

// The ball at a joint belongs to both segments.
bool is_same_place(const fabric::Tile& tile, std::uint32_t k, std::uint32_t l) {
  return tile.segment_strand[k] == tile.segment_strand[l] && (k > l ? k - l : l - k) <= 1;
}

// Compares on `rays` rays with limited length, so that brute force needs few copies. Rays that
// graze something within rounding may differ: at most one in a thousand.
void compare_with_brute_force(const fabric::Tile& tile, int rays, float t_max, int reach) {
  const Scene scene(tile);
  int different = 0;
  int hits = 0;
  for (int i = 0; i < rays; ++i) {
    core::Random random(7, static_cast<std::uint32_t>(i));
    const std::uint32_t k = random.below(tile.segment_count());
    const glm::vec3 origin = tile.wrapped_midpoint(k);
    const glm::vec3 direction = test::random_direction(random);
    const StrandCopy own = scene.own_copy(k);
    const auto expected = brute_force(scene, origin, direction, t_max, own, reach);
    const auto hit = scene.closest(origin, direction, t_max, own);
    const bool agrees = hit.has_value() == (expected.closest_entry < t_max) &&
                        (!hit || (std::abs(hit->t_mm - expected.closest_entry) < 2e-5 &&
                                  is_same_place(tile, hit->segment, expected.segment))) &&
                        scene.occluded(origin, direction, t_max, own) == expected.overlaps;
    different += agrees ? 0 : 1;
    hits += hit.has_value() ? 1 : 0;
  }
  EXPECT_LE(different, rays / 1000 + 1);
  EXPECT_GT(hits, rays / 20);
  EXPECT_LT(hits, rays - rays / 50);
}

TEST(TransportScene, Rays_AgreeWithBruteForceInHairs) {
  compare_with_brute_force(test::random_hairs(60, 0.5f, 0.4f, 0.2f, 3), 2000, 0.7f, 4);
}

TEST(TransportScene, Rays_AgreeWithBruteForceInCrossedLayers) {
  compare_with_brute_force(test::crossed_layers(4, 8, 0.02f, 6), 2000, 0.9f, 2);
}

TEST(TransportScene, Rays_AgreeWithBruteForceInATileSmallerThanItsFibres) {
  // The hairs are longer than the tile, which is also far smaller than its thickness.
  compare_with_brute_force(test::random_hairs(6, 0.08f, 0.05f, 0.6f, 5), 1000, 0.5f, 16);
}

TEST(TransportScene, ShortRays_SeeWhatHoldsTheirOriginAndNothingBeyond) {
  compare_with_brute_force(test::random_hairs(400, 0.3f, 0.3f, 0.1f, 9), 2000, 0.02f, 2);
}

TEST(TransportScene, ShiftByWholeTiles_ChangesNothing) {
  const fabric::Tile tile = test::random_hairs(60, 0.5f, 0.25f, 0.2f, 3);
  const Scene scene(tile);
  for (int i = 0; i < 500; ++i) {
    core::Random random(11, static_cast<std::uint32_t>(i));
    const glm::vec3 origin{0.5f * random.uniform(), 0.25f * random.uniform(),
                           0.2f * random.uniform()};
    const glm::vec3 direction = test::random_direction(random);
    // Powers of two: the shifted origins are the same to the last bit but a few.
    const glm::vec3 shifted = origin + glm::vec3{-2.0f, 4.0f, 0};
    const auto here = scene.closest(origin, direction, kFar, std::nullopt);
    const auto there = scene.closest(shifted, direction, kFar, std::nullopt);
    ASSERT_EQ(here.has_value(), there.has_value()) << i;
    if (here) {
      EXPECT_NEAR(here->t_mm, there->t_mm, 1e-4f);
      EXPECT_TRUE(is_same_place(tile, here->segment, there->segment));
      EXPECT_EQ(here->copy, there->copy);
    }
  }
}

TEST(TransportScene, AWarp_IsItselfAlongItselfAndAnotherFibreBeside) {
  // One straight fibre along y per tile.
  fabric::Tile tile = test::empty_tile(0.1f, 0.2f);
  test::add_strand(tile, {{0.05f, 0, 0}, {0.05f, 0.1f, 0}, {0.05f, 0.2f, 0}}, 0.01f, 0, 1);
  test::finish(tile);
  const Scene scene(tile);
  const glm::vec3 start = tile.wrapped_midpoint(0);
  const StrandCopy own = scene.own_copy(0);
  const glm::vec3 slightly_up = glm::normalize(glm::vec3{0, 1, 0.001f});
  EXPECT_FALSE(scene.occluded(start, slightly_up, kFar, own));
  EXPECT_TRUE(scene.occluded(start, slightly_up, kFar, std::nullopt));
  const auto beside = scene.closest(start, {1, 0, 0}, kFar, own);
  ASSERT_TRUE(beside.has_value());
  EXPECT_NEAR(beside->t_mm, 0.1f - 0.01f, 1e-6f);
  EXPECT_EQ(beside->copy, (StrandCopy{0, 1, 0}));
  // From the neighbour's side, the hit fibre is the one at home.
  EXPECT_EQ(scene.seen_from(beside->copy, {1, 5}), (StrandCopy{0, 0, 0}));
}

TEST(TransportScene, ObliquePeriods_AreReducedToOneName) {
  // A fibre that is one tile further in x when it is two further in y.
  fabric::Tile tile = test::empty_tile(0.1f, 0.1f);
  test::add_strand(tile, {{0, 0, 0}, {0.05f, 0.1f, 0}, {0.1f, 0.2f, 0}}, 0.01f, 1, 2);
  test::finish(tile);
  const Scene scene(tile);
  EXPECT_EQ(scene.seen_from({0, 3, 6}, {0, 0}), scene.seen_from({0, 0, 0}, {0, 0}));
  EXPECT_EQ(scene.seen_from({0, -1, -1}, {0, 0}), scene.seen_from({0, 0, 1}, {0, 0}));
  EXPECT_FALSE(scene.seen_from({0, 1, 1}, {0, 0}) == scene.seen_from({0, 0, 0}, {0, 0}));
  // Both segments of the strand see it as their own on both sides of the border.
  for (std::uint32_t k = 0; k < 2; ++k) {
    const glm::vec3 along = glm::normalize(glm::vec3{0.05f, 0.1f, 0.0001f});
    const auto hit = scene.closest(tile.wrapped_midpoint(k), along, 0.5f, scene.own_copy(k));
    EXPECT_FALSE(hit.has_value()) << k;
  }
}

TEST(TransportScene, FarRays_FindALonelyFibre) {
  // A grazing ray passes under hundreds of tiles before it meets the only layer.
  fabric::Tile tile = test::empty_tile(0.1f, 0.1f);
  test::add_strand(tile, {{0.05f, 0, 0}, {0.05f, 0.1f, 0}}, 0.001f, 0, 1);
  test::add_strand(tile, {{0.05f, 0, 1}, {0.05f, 0.1f, 1}}, 0.001f, 0, 1);
  test::finish(tile);
  const Scene scene(tile);
  const float slope = 0.001f;
  const glm::vec3 direction = glm::normalize(glm::vec3{1, 0.37f, slope});
  const auto hit = scene.closest({0.0f, 0.0f, 0.1f}, direction, kFar, std::nullopt);
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->segment, 1u);
  EXPECT_NEAR(hit->t_mm * direction.z, 0.9f, 0.002f);
  EXPECT_TRUE(scene.occluded({0.0f, 0.0f, 0.1f}, direction, kFar, std::nullopt));
  // From far above, and into empty space.
  EXPECT_TRUE(scene.closest({0.05f, 0.03f, 50}, {0, 0, -1}, kFar, std::nullopt).has_value());
  EXPECT_FALSE(scene.closest({0.05f, 0.03f, 50}, {0, 0, 1}, kFar, std::nullopt).has_value());
  EXPECT_FALSE(scene.occluded({0.05f, 0.03f, 50}, {0, 1, 0}, kFar, std::nullopt));
  // In the plane of a gap nothing is ever met, and the walk ends.
  EXPECT_FALSE(scene.occluded({0.05f, 0.03f, 0.5f}, {0, 1, 0}, kFar, std::nullopt));
}

TEST(TransportScene, RaysAlongAnAxis_MeetTheEndOfAFibreTheyRunAlong) {
  fabric::Tile tile = test::empty_tile(1, 1);
  test::add_strand(tile, {{0.4f, 0.5f, 0}, {0.6f, 0.5f, 0}}, 0.01f, 0, 0);
  test::finish(tile);
  const Scene scene(tile);
  const auto hit = scene.closest({0.1f, 0.5f, 0}, {1, 0, 0}, kFar, std::nullopt);
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->t_mm, 0.29f, 1e-4f);
  EXPECT_TRUE(scene.occluded({0.1f, 0.5f, 0}, {1, 0, 0}, kFar, std::nullopt));
  EXPECT_TRUE(scene.occluded({0.1f, 0.5f, 0}, {-1, 0, 0}, kFar, std::nullopt));
}

TEST(TransportScene, OriginInside_IsBlockedForVisibilityAndOpenForTransport) {
  fabric::Tile tile = test::empty_tile(1, 1);
  test::add_strand(tile, {{0.4f, 0.5f, 0}, {0.6f, 0.5f, 0}}, 0.1f, 0, 0);
  test::finish(tile);
  const Scene scene(tile);
  const glm::vec3 inside{0.5f, 0.52f, 0.01f};
  const glm::vec3 up{0, 0.1f, 0.995f};
  EXPECT_TRUE(scene.occluded(inside, glm::normalize(up), kFar, std::nullopt));
  EXPECT_TRUE(scene.occluded(inside, glm::normalize(up), 0.001f, std::nullopt));
  EXPECT_FALSE(scene.closest(inside, glm::normalize(up), kFar, std::nullopt).has_value());
}

TEST(TransportScene, CallersFloatMode_IsKept) {
  const fabric::Tile tile = test::crossed_layers(2, 4, 0.02f, 2);
  const Scene scene(tile);
  const unsigned before = _mm_getcsr() & ~0x3fu;
  static_cast<void>(scene.occluded({0, 0, 0}, {0, 0, 1}, kFar, std::nullopt));
  EXPECT_EQ(_mm_getcsr() & ~0x3fu, before);
}

TEST(TransportScene, EmptyTile_IsRefused) {
  fabric::Tile tile = test::empty_tile(1, 1);
  tile.z_min_mm = 0;
  tile.z_max_mm = 1;
  EXPECT_THROW(Scene{tile}, core::Error);
}

}  // namespace
}  // namespace weft::transport
