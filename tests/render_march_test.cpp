#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "render/flat_cloth.h"
#include "render/gpu/geometry.h"
#include "render/kernels/eye_ray.h"
#include "render/scene.h"
#include "render/shell_cloth.h"
#include "tests/render_cloths.h"

// The shared text of render/kernels/eye_ray.h, compiled as C++, against Embree through
// render/scene.h.
namespace weft::render {
namespace {

using Cloths = std::vector<std::unique_ptr<Cloth>>;

shading::DeviceHit found(const gpu::GeometryArrays& arrays, const Ray& ray,
                         int nearest_samples = 0) {
  const auto cloths = static_cast<int>(arrays.cloths.size());
  const shading::EyeRay eye{glm::vec3(ray.origin_mm), glm::vec3(ray.direction)};
  shading::EyeProgress progress = shading::eye_begin(eye);
  for (int round = 0; round < 1000 && progress.search.cloth < cloths; ++round) {
    progress = shading::eye_on(&arrays, cloths, eye, progress, nearest_samples);
  }
  EXPECT_EQ(progress.search.cloth, cloths);
  return progress.hit;
}

// Rounded to single precision, so that both follow the same ray.
Ray rounded(const glm::dvec3& origin, const glm::dvec3& direction) {
  return {glm::dvec3(glm::vec3(origin)), glm::dvec3(glm::vec3(glm::normalize(direction)))};
}

struct Comparison {
  int met = 0;
  int absorbed = 0;
  int different = 0;
  int at_joints = 0;
  // Where a ray all but touches a fibre of radius r, rounding by e moves the hit by sqrt(2 r e).
  int grazing = 0;
};

void compare(Comparison& result, const Scene& scene, const gpu::GeometryArrays& arrays,
             const Ray& ray) {
  const SceneMeeting expected = closest(scene, ray, kInfinity, nullptr);
  const shading::DeviceHit actual = found(arrays, ray);
  result.met += expected.fate == Fate::kFibre ? 1 : 0;
  result.absorbed += expected.fate == Fate::kAbsorbed ? 1 : 0;
  const int fate = expected.fate == Fate::kFibre      ? shading::kHitFibre
                   : expected.fate == Fate::kAbsorbed ? shading::kHitAbsorbed
                                                      : shading::kHitNothing;
  if (actual.fate != fate) {
    ++result.different;
    return;
  }
  if (fate != shading::kHitFibre) {
    return;
  }
  const FibreHit& hit = expected.hit.fibre;
  const double apart = std::fabs(static_cast<double>(actual.t_mm) - hit.t_mm);
  EXPECT_EQ(arrays.sources[static_cast<std::size_t>(actual.fabric)],
            &scene.cloths[expected.hit.cloth]->fabric(hit));
  const bool same = actual.segment == static_cast<int>(hit.segment) &&
                    actual.cloth == static_cast<int>(expected.hit.cloth);
  // Two segments of one fibre share the sphere where they meet: either may be named.
  if (apart > (same ? 2e-3 : 1e-4)) {
    ++result.different;
    return;
  }
  result.at_joints += same ? 0 : 1;
  result.grazing += apart > 1e-4 ? 1 : 0;
  EXPECT_LT(glm::distance(glm::dvec3(actual.flat_mm), hit.flat_mm), 2e-3);
  EXPECT_LT(glm::distance(glm::dvec3(actual.world_mm), hit.world_mm), 2e-3);
}

Scene scene_of(Cloths cloths) {
  Scene scene;
  scene.cloths = std::move(cloths);
  return scene;
}

Scene swatch(fabric::Tile tile, const FlatPlacement& placement) {
  Cloths cloths;
  cloths.push_back(make_flat_cloth(test::fabric_of(std::move(tile)), placement));
  return scene_of(std::move(cloths));
}

FlatPlacement sized(double size_mm) {
  FlatPlacement placement;
  placement.size_mm = {size_mm, size_mm};
  return placement;
}

// From around a piece to points within it, a third of them nearly level, some along the axes.
Ray eye_ray_at(const glm::dvec3& centre, const glm::dvec3& half, std::uint64_t i) {
  core::Random random(11, 0, i);
  const auto around = [&] { return 2 * random.uniform_double() - 1; };
  const glm::dvec3 target = centre + half * glm::dvec3(around(), around(), around());
  glm::dvec3 direction(test::random_direction(random));
  if (i % 3 == 0) {
    direction.z *= 0.05;
  }
  if (i % 20 == 1) {
    direction = i % 40 == 1 ? glm::dvec3(0, 0, -1) : glm::dvec3(0, 0, 1);
  }
  const double away = 10 + 100 * random.uniform_double();
  return rounded(target - away * glm::normalize(direction), direction);
}

TEST(March, MeetsTheFibresThatEmbreeMeetsInFlatCloth) {
  FlatPlacement turned = sized(6);
  turned.turn = 0.9;
  turned.centre_mm = {20, -30, 5};
  turned.black_underlay = true;
  FlatPlacement endless = sized(6);
  endless.endless = true;
  const std::vector<std::pair<fabric::Tile, FlatPlacement>> swatches = {
      {test::crossed_layers(4, 6, 0.05f, 2), sized(6)},
      {test::crossed_layers(6, 9, 0.04f, 5), turned},
      {test::crossed_layers(3, 2, 0.02f, 3), endless},
      {test::crossed_layers(2, 3, 0.04f, 1), sized(6)},  // segments as long as the tile
      {test::random_hairs(150, 0.5f, 0.4f, 0.3f, 1), sized(6)},
      {test::random_hairs(40, 0.11f, 0.07f, 0.2f, 2), sized(6)},  // hairs longer than the tile
      {test::random_hairs(60, 1.5f, 2.0f, 3.0f, 3), endless},
  };
  for (std::size_t s = 0; s < swatches.size(); ++s) {
    const auto& [tile, placement] = swatches[s];
    const Scene scene = swatch(tile, placement);
    const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
    const Cloth::Bounds bounds = scene.cloths[0]->bounds();
    Comparison result;
    for (std::uint64_t i = 0; i < 3000; ++i) {
      compare(result, scene, arrays,
              eye_ray_at(0.5 * (bounds.low_mm + bounds.high_mm),
                         0.5 * (bounds.high_mm - bounds.low_mm), i));
    }
    EXPECT_GT(result.met, 500) << "swatch " << s;
    EXPECT_EQ(result.absorbed > 0, placement.black_underlay) << "swatch " << s;
    EXPECT_LE(result.different, 3) << "swatch " << s;  // rays that touch a fibre, or two at once
    EXPECT_LE(result.at_joints, 200) << "swatch " << s;
    EXPECT_LE(result.grazing, 30) << "swatch " << s;
  }
}

TEST(March, MeetsTheFibresThatEmbreeMeetsInShells) {
  const auto curtain = [](glm::dvec2 p) { return test::in_folds(p) + glm::dvec3(5, 60, -20); };
  for (const bool underlay : {false, true}) {
    Cloths cloths;
    cloths.push_back(test::shell_of(test::fabric_of(test::crossed_layers(4, 6, 0.05f, 2)),
                                    test::sheet(40, 3, curtain), underlay));
    const Scene scene = scene_of(std::move(cloths));
    const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
    const Cloth::Bounds bounds = scene.cloths[0]->bounds();
    Comparison result;
    for (std::uint64_t i = 0; i < 6000; ++i) {
      compare(result, scene, arrays,
              eye_ray_at(0.5 * (bounds.low_mm + bounds.high_mm),
                         0.5 * (bounds.high_mm - bounds.low_mm), i));
    }
    EXPECT_GT(result.met, 2000);
    EXPECT_EQ(result.absorbed > 0, underlay);
    EXPECT_LE(result.different, 12);
    EXPECT_LE(result.at_joints, 60);
    EXPECT_LE(result.grazing, 30);
  }
}

TEST(March, MeetsTheFibresThatEmbreeMeetsInPatternedCloth) {
  FlatPlacement turned = sized(6);
  turned.turn = 0.9;
  turned.centre_mm = {20, -30, 5};
  FlatPlacement endless = sized(6);
  endless.endless = true;
  std::vector<std::string> remarks;
  ShellPlacement true_to_size;
  true_to_size.texture_mm = {1, 1};
  Cloths pieces;
  pieces.push_back(make_flat_cloth(test::damask(), turned));
  pieces.push_back(make_flat_cloth(test::damask(), endless));
  pieces.push_back(
      make_shell_cloth(test::damask(), test::sheet(40, 3, test::in_folds), true_to_size, remarks));
  for (auto& piece : pieces) {
    Cloths one;
    one.push_back(std::move(piece));
    const Scene scene = scene_of(std::move(one));
    const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
    ASSERT_EQ(arrays.fabrics.size(), 2U);
    const Cloth::Bounds bounds = scene.cloths[0]->bounds();
    Comparison result;
    for (std::uint64_t i = 0; i < 3000; ++i) {
      compare(result, scene, arrays,
              eye_ray_at(0.5 * (bounds.low_mm + bounds.high_mm),
                         0.5 * (bounds.high_mm - bounds.low_mm), i));
    }
    EXPECT_GT(result.met, 1000);
    // Borders of blocks cut fibres, and a ray that grazes the cut may be on either side of it.
    EXPECT_LE(result.different, 6);
  }
}

}  // namespace
}  // namespace weft::render
