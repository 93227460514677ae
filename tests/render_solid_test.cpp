#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "render/flat_cloth.h"
#include "render/gpu/bounds_tree.h"
#include "render/gpu/geometry.h"
#include "render/kernels/solid.h"
#include "tests/render_cloths.h"

// The shared text of render/kernels/solid.h, compiled as C++, against render/cloth.h.
namespace weft::render {
namespace {

using Cloths = std::vector<std::unique_ptr<Cloth>>;

std::shared_ptr<const Fabric> fabric() {
  return test::fabric_of(test::crossed_layers(4, 6, 0.05f, 2));
}

Cloths every_kind_of_piece() {
  const auto cloth = fabric();
  Cloths cloths;
  FlatPlacement swatch;
  swatch.size_mm = {6, 4};
  swatch.turn = 0.7;
  swatch.centre_mm = {10, -20, 3};
  cloths.push_back(make_flat_cloth(cloth, swatch));
  swatch.endless = true;
  swatch.centre_mm = {0.3, 0.2, -150};
  cloths.push_back(make_flat_cloth(cloth, swatch));
  cloths.push_back(test::shell_of(cloth, test::sheet(40, 3, [](glm::dvec2 p) {
                                    return test::in_folds(p) + glm::dvec3(30, 5, 100);
                                  })));
  cloths.push_back(
      test::shell_of(cloth, test::sheet(3, 3, [](glm::dvec2 p) { return glm::dvec3(p, 0); })));
  return cloths;
}

glm::dvec3 direction_of(core::Random& random) { return glm::dvec3(test::random_direction(random)); }

// A point in or about a piece, but never outside its bounds by more than their size.
glm::dvec3 point_about(const Cloth& cloth, core::Random& random) {
  const Cloth::Bounds bounds = cloth.bounds();
  glm::dvec3 at(0);
  for (int axis = 0; axis < 3; ++axis) {
    const double share = 2 * random.uniform_double() - 0.5;
    at[axis] = bounds.low_mm[axis] + share * (bounds.high_mm[axis] - bounds.low_mm[axis]);
  }
  return at;
}

TEST(Solid, BlocksWhatTheClothBlocks) {
  const Cloths cloths = every_kind_of_piece();
  const gpu::GeometryArrays arrays = gpu::pack_geometry(cloths);
  for (std::size_t c = 0; c < cloths.size(); ++c) {
    int blocked = 0;
    int different = 0;
    for (std::uint64_t i = 0; i < 4000; ++i) {
      core::Random random(5, static_cast<std::uint32_t>(c), i);
      // Rounded, so that both follow the same ray.
      const glm::vec3 origin(point_about(*cloths[c], random));
      const glm::vec3 direction(direction_of(random));
      const double t_max = i % 3 == 0 ? 0.5 : kInfinity;
      const bool expected = cloths[c]->blocks({glm::dvec3(origin), glm::dvec3(direction)}, t_max);
      const bool actual = shading::cloth_blocks(&arrays, static_cast<int>(c), origin, direction,
                                                t_max < 1 ? 0.5f : 1e30f);
      blocked += expected ? 1 : 0;
      different += expected != actual ? 1 : 0;
    }
    EXPECT_GT(blocked, 300) << "piece " << c;
    EXPECT_LT(blocked, 3900) << "piece " << c;
    EXPECT_LE(different, 2) << "piece " << c;  // at edges, by rounding
  }
}

TEST(Solid, TopPointsAreThoseOfTheClothAndFreeUpwards) {
  const Cloths cloths = every_kind_of_piece();
  const gpu::GeometryArrays arrays = gpu::pack_geometry(cloths);
  for (std::size_t c = 0; c < cloths.size(); ++c) {
    int met = 0;
    int beyond = 0;
    for (std::uint64_t i = 0; i < 2000; ++i) {
      core::Random random(6, static_cast<std::uint32_t>(c), i);
      const Cloth::Bounds bounds = cloths[c]->bounds();
      const glm::dvec3 target = point_about(*cloths[c], random);
      const glm::dvec3 origin =
          0.5 * (bounds.low_mm + bounds.high_mm) + 30.0 * direction_of(random);
      const Ray ray{origin, glm::normalize(target - origin)};
      const Meeting meeting = cloths[c]->closest(ray, kInfinity, nullptr);
      if (meeting.fate != Fate::kFibre) {
        continue;
      }
      ++met;
      const glm::dvec2 offset(2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1);
      const auto expected = cloths[c]->top_point(meeting.hit, offset);
      const bool flat = arrays.cloths[c].kind == shading::kClothFlat;
      const int place = flat ? -1 : static_cast<int>(meeting.hit.place);
      const shading::TopPoint actual = shading::top_point(
          &arrays, static_cast<int>(c), place, glm::vec3(meeting.hit.flat_mm), glm::vec2(offset));
      ASSERT_EQ(expected.has_value(), actual.exists) << "piece " << c << " ray " << i;
      for (int column = 0; column < 3; ++column) {
        EXPECT_LT(glm::distance(shading::rotation_at(&arrays, static_cast<int>(c), place)[column],
                                meeting.hit.to_flat[column]),
                  1e-6f);
      }
      if (!expected) {
        ++beyond;
        continue;
      }
      EXPECT_LT(glm::distance(*expected, glm::dvec3(actual.world_mm)), 6e-5) << "piece " << c;
      if (flat) {  // a shell may shadow itself
        glm::vec3 up(direction_of(random));
        up.z = std::fabs(up.z) + 1e-3f;
        EXPECT_FALSE(shading::cloth_blocks(&arrays, static_cast<int>(c), actual.world_mm,
                                           glm::normalize(up), 1e30f));
      }
    }
    EXPECT_GT(met, 100) << "piece " << c;
    EXPECT_EQ(beyond > 0, c != 1) << "piece " << c;
  }
}

TEST(BoundsTree, HoldsEveryBoxOnceWithinTheKernelsStack) {
  for (const int count : {1, 4, 5, 1000, 20000}) {
    std::vector<gpu::Box> boxes;
    for (int i = 0; i < count; ++i) {
      core::Random random(7, static_cast<std::uint32_t>(i));
      // Most of them in one place, so that no split by area separates them.
      const float spread = i % 4 == 0 ? 100.0f : 0.0f;
      const glm::vec3 at = spread * glm::vec3(random.uniform(), random.uniform(), random.uniform());
      boxes.push_back({at, at + random.uniform()});
    }
    const gpu::BoundsTree tree = gpu::build_bounds_tree(boxes);
    std::vector<int> found(boxes.size(), 0);
    struct Visit {
      std::size_t node;
      int depth;
    };
    std::vector<Visit> visits{{0, 1}};
    while (!visits.empty()) {
      const Visit visit = visits.back();
      visits.pop_back();
      const shading::DeviceNode& node = tree.nodes[visit.node];
      ASSERT_LT(visit.depth, shading::kTreeStack);
      for (int i = 0; i < node.count; ++i) {
        const std::uint32_t box = tree.order[static_cast<std::size_t>(node.first + i)];
        ++found[box];
        EXPECT_TRUE(glm::all(glm::lessThanEqual(node.low_mm, boxes[box].low_mm)));
        EXPECT_TRUE(glm::all(glm::greaterThanEqual(node.high_mm, boxes[box].high_mm)));
      }
      if (node.count < 0) {
        visits.push_back({static_cast<std::size_t>(node.first), visit.depth + 1});
        visits.push_back({static_cast<std::size_t>(node.first) + 1, visit.depth + 1});
      }
    }
    EXPECT_EQ(std::count(found.begin(), found.end(), 1), count);
  }
}

}  // namespace
}  // namespace weft::render
