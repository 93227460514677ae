#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "fabric/build.h"
#include "fabric/description.h"
#include "tests/ray_agreement.h"
#include "tests/transport_tiles.h"
#include "transport/embree_scene.h"
#include "transport/ray_kernel.h"
#include "transport/scene.h"
#include "transport/wide.h"

namespace weft::transport {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

fabric::Tile example(const char* name) {
  return fabric::build_tile(fabric::load_description(
      std::string(WEFT_SOURCE_DIR "/examples/") + name + ".textproto", v1::QUALITY_PREVIEW));
}

std::vector<std::uint32_t> some_segments(const fabric::Tile& tile, std::uint32_t count) {
  std::vector<std::uint32_t> segments;
  for (std::uint32_t i = 0; i < count; ++i) {
    segments.push_back(core::Random(3, 0, i).below(tile.segment_count()));
  }
  return segments;
}

// A third of a million rays in each of three fabrics: what Embree answers, up to rounding.
TEST(TransportRayKernel, AMillionRays_MeetWhatEmbreeSaysTheyMeet) {
  for (const char* name : {"satin_4_1", "silk_plain", "fleece"}) {
    const fabric::Tile tile = example(name);
    const Scene scene(tile);
    const EmbreeScene embree(tile);
    test::Disagreement sum;
    std::uint64_t other_shadows = 0;
    for (const test::TracedRay& ray :
         test::rays_of_walks(scene, some_segments(tile, 1500), 40, 1'000'000 / 3)) {
      test::compare(scene, ray, scene.closest(ray.origin_mm, ray.direction, kFar, ray.ignored),
                    embree.closest(ray.origin_mm, ray.direction, kFar, ray.ignored), sum);
      other_shadows += scene.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored) !=
                               embree.occluded(ray.origin_mm, ray.direction, kFar, ray.ignored)
                           ? 1
                           : 0;
    }
    std::printf("%s: %ju rays, %ju hits; differ: %ju fibres, %ju joints, %ju grazes, %ju shadows\n",
                name, std::uintmax_t{sum.rays}, std::uintmax_t{sum.hits},
                std::uintmax_t{sum.fibres}, std::uintmax_t{sum.joints}, std::uintmax_t{sum.grazes},
                std::uintmax_t{other_shadows});
    EXPECT_EQ(sum.rays, 1'000'000U / 3);
    EXPECT_GT(sum.hits, sum.rays / 2);
    EXPECT_LT(sum.fibres, sum.rays / 10'000);
    EXPECT_LT(other_shadows, sum.rays / 10'000);
    EXPECT_EQ(sum.unexplained, 0U);
    EXPECT_LT(scene.size_bytes(), embree.size_bytes());
  }
}

// Rays of all sorts: along the axes, from above, from far away, short ones.
std::vector<test::TracedRay> rays_of_all_sorts(const Scene& scene) {
  std::vector<test::TracedRay> rays =
      test::rays_of_walks(scene, some_segments(scene.tile(), 200), 4, 3000);
  const std::size_t walked = rays.size();
  for (std::size_t i = 0; i < walked; i += 7) {
    test::TracedRay ray = rays[i];
    const int axis = static_cast<int>(i % 3);
    ray.direction = glm::vec3(i % 5 == 0 ? -0.0f : 0.0f);
    ray.direction[axis] = i % 2 == 0 ? 1.0f : -1.0f;
    rays.push_back(ray);
    ray.origin_mm += glm::vec3{31, -17, 5};
    ray.direction = glm::normalize(-ray.origin_mm);
    rays.push_back(ray);
    // Along a fibre, within and beside it.
    const fabric::Segment s =
        scene.tile().segment(static_cast<std::uint32_t>(i) % scene.tile().segment_count());
    rays.push_back({s.a_mm - 3.0f * (s.b_mm - s.a_mm), glm::normalize(s.b_mm - s.a_mm), {}});
    rays.push_back({s.a_mm + glm::vec3{0, 0, s.radius_mm}, glm::normalize(s.b_mm - s.a_mm), {}});
  }
  return rays;
}

TEST(TransportRayKernel, WideAndPortable_GiveTheSameBits) {
  if (!wide_is_available()) {
    GTEST_SKIP() << "this processor has no AVX-512";
  }
  const std::array<std::function<fabric::Tile()>, 4> tiles{
      [] { return example("tiny"); }, [] { return test::crossed_layers(4, 8, 0.02f, 6); },
      [] { return test::random_hairs(400, 0.3f, 0.3f, 0.1f, 9); },
      [] { return test::random_hairs(6, 0.08f, 0.05f, 0.6f, 5); }};
  for (const auto& make : tiles) {
    const fabric::Tile tile = make();
    const Scene wide(tile, true);
    const Scene portable(tile, false);
    int hits = 0;
    for (const test::TracedRay& ray : rays_of_all_sorts(wide)) {
      for (const float t_max : {kFar, 0.05f}) {
        const auto one = wide.closest(ray.origin_mm, ray.direction, t_max, ray.ignored);
        const auto other = portable.closest(ray.origin_mm, ray.direction, t_max, ray.ignored);
        ASSERT_EQ(one.has_value(), other.has_value());
        if (one) {
          ++hits;
          EXPECT_EQ(one->t_mm, other->t_mm);
          EXPECT_EQ(one->segment, other->segment);
          EXPECT_EQ(one->copy, other->copy);
        }
        EXPECT_EQ(wide.occluded(ray.origin_mm, ray.direction, t_max, ray.ignored),
                  portable.occluded(ray.origin_mm, ray.direction, t_max, ray.ignored));
      }
    }
    EXPECT_GT(hits, 500);
  }
}

TEST(TransportRayKernel, DirectionsOfNegativeZero_AreThoseOfZero) {
  const fabric::Tile tile = test::crossed_layers(4, 8, 0.02f, 6);
  const Scene scene(tile, false);
  int hits = 0;
  for (const test::TracedRay& ray : rays_of_all_sorts(scene)) {
    const glm::vec3 flat =
        std::abs(ray.direction.x) < 0.5f ? glm::vec3{0, 0.6f, 0.8f} : glm::vec3{0.6f, 0, 0.8f};
    const glm::vec3 other{flat.x == 0 ? -0.0f : flat.x, flat.y == 0 ? -0.0f : flat.y, flat.z};
    const auto one = scene.closest(ray.origin_mm, flat, kFar, ray.ignored);
    const auto two = scene.closest(ray.origin_mm, other, kFar, ray.ignored);
    ASSERT_EQ(one.has_value(), two.has_value());
    EXPECT_TRUE(!one || (one->t_mm == two->t_mm && one->segment == two->segment));
    hits += one ? 1 : 0;
  }
  EXPECT_GT(hits, 100);
}

// The tree with one leaf alone in it.
FibreTree only_leaf(const FibreTree& tree, std::uint32_t leaf) {
  FibreTree one = tree;
  for (std::uint32_t block = 0; block < FibreTree::kBlocks; ++block) {
    one.top.child[block] = BoxTree::kLeaf | leaf | block << FibreTree::kBlockShift;
  }
  return one;
}

TEST(TransportRayKernel, TheHierarchy_LosesNoHitToItsBoxesAndItsOrder) {
  const fabric::Tile tile = test::random_hairs(100, 0.3f, 0.2f, 0.1f, 21);
  const EndlessTile endless(tile);
  const FibreTree tree(endless);
  std::vector<TreeRay> rays;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    core::Random random(4, i);
    const float x = random.uniform() * static_cast<float>(endless.block_size_mm.x);
    const float y = random.uniform() * static_cast<float>(endless.block_size_mm.y);
    rays.push_back({{x, y, 0.1f * random.uniform()}, test::any_direction(random), 0.5f, {}});
  }
  std::vector<TreeHit> nearest(rays.size(), TreeHit{0.5f});
  std::vector<bool> blocked(rays.size(), false);
  for (std::uint32_t leaf = 0; leaf < tree.leaves.size(); ++leaf) {
    const FibreTree one = only_leaf(tree, leaf);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const TreeHit hit = closest_portable(one, rays[i]);
      if (hit.t_mm < nearest[i].t_mm ||
          (hit.t_mm == nearest[i].t_mm && hit.order < nearest[i].order)) {
        nearest[i] = hit;
      }
      blocked[i] = blocked[i] || occluded_portable(one, rays[i]);
    }
  }
  int hits = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const TreeHit hit = closest_portable(tree, rays[i]);
    EXPECT_EQ(hit.order, nearest[i].order) << i;
    EXPECT_EQ(hit.t_mm, nearest[i].t_mm) << i;
    EXPECT_EQ(occluded_portable(tree, rays[i]), blocked[i]) << i;
    hits += hit.order != TreeHit::kNone ? 1 : 0;
  }
  EXPECT_GT(hits, 1000);
}

TEST(TransportRayKernel, OfTwoFibresInOnePlace_TheFirstSegmentIsMet) {
  fabric::Tile tile = test::empty_tile(1, 1);
  for (int i = 0; i < 40; ++i) {
    test::add_strand(tile, {{0.4f, 0.5f, 0}, {0.6f, 0.5f, 0}}, 0.05f, 0, 0);
  }
  test::finish(tile);
  const Scene scene(tile, false);
  const auto hit = scene.closest({0.5f, 0.5f, 1}, {0, 0, -1}, kFar, {});
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->segment, 0U);
  const auto next = scene.closest({0.5f, 0.5f, 1}, {0, 0, -1}, kFar, StrandCopy{0, 0, 0});
  ASSERT_TRUE(next.has_value());
  EXPECT_EQ(next->segment, 1U);
}

}  // namespace
}  // namespace weft::transport
