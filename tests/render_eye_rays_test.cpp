#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/gpu/eye_rays.h"
#include "render/kernels/eye_ray.h"
#include "render/scene.h"
#include "tests/render_cloths.h"

// The kernel eye_rays against the same text in C++ and against the CPU's eye rays.
namespace weft::render {
namespace {

using shading::DeviceHit;

constexpr std::uint32_t kWidth = 96;
constexpr std::uint32_t kHeight = 80;

// Two pieces of one fabric, one of another and a patterned one, one in front of the other.
Scene four_pieces(bool perspective) {
  Scene scene;
  const auto crossed = test::fabric_of(test::crossed_layers(4, 6, 0.05f, 2));
  const auto hairs = test::fabric_of(test::random_hairs(150, 0.5f, 0.4f, 0.3f, 1));
  FlatPlacement swatch;
  swatch.size_mm = {6, 6};
  swatch.turn = 0.4;
  swatch.centre_mm = {0.5, 0, -2};
  swatch.black_underlay = true;
  scene.cloths.push_back(make_flat_cloth(crossed, swatch));
  scene.cloths.push_back(test::shell_of(crossed, test::sheet(30, 2, test::in_folds)));
  swatch.size_mm = {2, 1.5};
  swatch.centre_mm = {-1.5, -1, 1.5};
  scene.cloths.push_back(make_flat_cloth(hairs, swatch));
  swatch.centre_mm = {1.5, 1.2, 1};
  scene.cloths.push_back(make_flat_cloth(test::damask(), swatch));
  Camera::View view;
  view.position_mm = {4, -20, 25};
  view.look_at_mm = {0, 0, 0};
  view.up = {0, 0, 1};
  view.perspective = perspective;
  view.height = perspective ? 0.2 : 6;
  scene.camera = Camera(view, static_cast<double>(kWidth) / kHeight);
  return scene;
}

gpu::EyeView view_of(const Scene& scene) {
  gpu::EyeView view;
  view.camera = scene.camera;
  view.width = kWidth;
  view.height = kHeight;
  view.seed = 7;
  return view;
}

class EyeRays : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    gpu::DeviceOptions options;
    options.validation = gpu::Validation::kOn;
    device_ = gpu::Device::open("", options);
  }
  static void TearDownTestSuite() { device_.reset(); }
  void TearDown() override { EXPECT_THAT(device_->complaints(), testing::IsEmpty()); }

  static std::vector<DeviceHit> followed(gpu::EyeRays& rays, const gpu::EyeBatch& batch) {
    static_cast<void>(rays.follow(batch));
    return device_->download<DeviceHit>(rays.hits(), batch.rays());
  }

  // The same by the C++ build of the kernel's text.
  static std::vector<DeviceHit> followed_in_cpp(const gpu::GeometryArrays& arrays,
                                                const gpu::EyeView& view,
                                                const gpu::EyeBatch& batch) {
    const auto cloths = static_cast<int>(arrays.cloths.size());
    const shading::EyeTask task = gpu::eye_task(view, batch, cloths);
    std::vector<DeviceHit> hits;
    for (int i = 0; i < static_cast<int>(batch.rays()); ++i) {
      const shading::EyeRay ray = shading::eye_ray(task, i);
      shading::EyeProgress progress = shading::eye_begin(ray);
      while (progress.search.cloth < cloths) {
        progress = shading::eye_on(&arrays, cloths, ray, progress, task.nearest_samples);
      }
      hits.push_back(progress.hit);
    }
    return hits;
  }

  static std::unique_ptr<gpu::Device> device_;
};

std::unique_ptr<gpu::Device> EyeRays::device_;

bool same_hit(const DeviceHit& a, const DeviceHit& b) {
  return a.fate == b.fate && a.cloth == b.cloth && a.fabric == b.fabric && a.segment == b.segment &&
         a.place == b.place;
}

gpu::EyeBatch whole_picture(std::uint32_t samples) {
  gpu::EyeBatch batch;
  batch.columns = kWidth;
  batch.rows = kHeight;
  batch.sample_count = samples;
  return batch;
}

TEST_F(EyeRays, TheKernelDoesWhatItsTextDoesInCpp) {
  for (const bool perspective : {true, false}) {
    const Scene scene = four_pieces(perspective);
    gpu::GeometrySettings settings;
    settings.nearest_volume = true;
    const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths, settings);
    const gpu::DeviceGeometry geometry(*device_, arrays);
    for (const std::uint32_t samples : {0U, 64U}) {
      gpu::EyeView view = view_of(scene);
      view.nearest_samples = samples;
      const gpu::EyeBatch batch = whole_picture(2);
      gpu::EyeRays rays(*device_, geometry, view, batch.rays());
      const std::vector<DeviceHit> on_device = followed(rays, batch);
      const std::vector<DeviceHit> in_cpp = followed_in_cpp(arrays, view, batch);
      int fibres = 0;
      int different = 0;
      for (std::size_t i = 0; i < on_device.size(); ++i) {
        fibres += in_cpp[i].fate == shading::kHitFibre ? 1 : 0;
        different += same_hit(on_device[i], in_cpp[i]) ? 0 : 1;
        EXPECT_LT(glm::distance(on_device[i].to_eye, in_cpp[i].to_eye), 1e-6f);
        if (same_hit(on_device[i], in_cpp[i]) && in_cpp[i].fate != shading::kHitNothing) {
          EXPECT_NEAR(on_device[i].t_mm, in_cpp[i].t_mm, 2e-3);
          EXPECT_LT(glm::distance(on_device[i].world_mm, in_cpp[i].world_mm), 2e-3f);
          EXPECT_LT(glm::distance(on_device[i].flat_mm, in_cpp[i].flat_mm), 2e-3f);
        }
      }
      EXPECT_GT(fibres, 5000);
      // Rays that all but touch a fibre, or meet two segments where they join.
      EXPECT_LT(different, static_cast<int>(on_device.size() / 200));
    }
  }
}

TEST_F(EyeRays, ShowTheSegmentsThatTheCpuShows) {
  const Scene scene = four_pieces(true);
  const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
  const gpu::DeviceGeometry geometry(*device_, arrays);
  const gpu::EyeView view = view_of(scene);
  const gpu::EyeBatch batch = whole_picture(2);
  gpu::EyeRays rays(*device_, geometry, view, batch.rays());
  const std::vector<DeviceHit> hits = followed(rays, batch);
  const std::uint64_t seed = core::derive_seed(view.seed, kPurposeOfEyeRays);
  int fibres = 0;
  int different = 0;
  int at_joints = 0;
  for (std::uint32_t i = 0; i < hits.size(); ++i) {
    const std::uint32_t pixel = i / batch.sample_count;
    core::Random random(seed, pixel, i % batch.sample_count);
    const double dx = random.uniform_double();
    const double dy = random.uniform_double();
    const Ray ray =
        scene.camera.ray({(pixel % kWidth + dx) / kWidth, (pixel / kWidth + dy) / kHeight});
    const SceneMeeting meeting = closest(scene, ray, kInfinity, nullptr);
    const bool fibre = meeting.fate == Fate::kFibre;
    fibres += fibre ? 1 : 0;
    if (fibre != (hits[i].fate == shading::kHitFibre) ||
        (meeting.fate == Fate::kAbsorbed) != (hits[i].fate == shading::kHitAbsorbed)) {
      ++different;
    } else if (fibre && hits[i].segment != static_cast<int>(meeting.hit.fibre.segment)) {
      const double apart = std::fabs(static_cast<double>(hits[i].t_mm) - meeting.t_mm);
      (apart < 1e-4 ? at_joints : different) += 1;
    }
  }
  EXPECT_GT(fibres, 5000);
  EXPECT_LT(different, static_cast<int>(hits.size() / 1000));
  EXPECT_LT(at_joints, fibres / 50);
}

TEST_F(EyeRays, DoNotDependOnHowAPictureIsDivided) {
  const Scene scene = four_pieces(true);
  const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
  const gpu::DeviceGeometry geometry(*device_, arrays);
  const gpu::EyeBatch whole = whole_picture(3);
  gpu::EyeRays rays(*device_, geometry, view_of(scene), whole.rays());
  const std::vector<DeviceHit> all = followed(rays, whole);
  for (std::uint32_t top = 0; top < kHeight; top += 33) {
    for (std::uint32_t left = 0; left < kWidth; left += 41) {
      for (std::uint32_t sample = 0; sample < 3; ++sample) {
        const gpu::EyeBatch part{
            left, top, std::min(41U, kWidth - left), std::min(33U, kHeight - top), sample, 1};
        const std::vector<DeviceHit> hits = followed(rays, part);
        for (std::uint32_t i = 0; i < hits.size(); ++i) {
          const std::uint32_t pixel = (top + i / part.columns) * kWidth + left + i % part.columns;
          const DeviceHit& expected = all[std::size_t{3} * pixel + sample];
          ASSERT_TRUE(same_hit(hits[i], expected));
          ASSERT_EQ(hits[i].t_mm, expected.t_mm);
        }
      }
    }
  }
}

TEST_F(EyeRays, KeepTheGridsOfFabricsThatLive) {
  gpu::GridCache cache;
  {
    const Scene scene = four_pieces(true);
    const gpu::GeometryArrays first = gpu::pack_geometry(scene.cloths, {}, &cache);
    EXPECT_EQ(cache.size(), first.fabrics.size());
    const Fabric& fabric = scene.cloths[0]->fabric();
    const gpu::FabricGrid* grid = &cache.grid_of(fabric, {});
    const gpu::GeometryArrays again = gpu::pack_geometry(scene.cloths, {}, &cache);
    EXPECT_EQ(&cache.grid_of(fabric, {}), grid);
    EXPECT_EQ(again.entries, first.entries);
    EXPECT_EQ(again.voxels, first.voxels);
    gpu::GeometrySettings coarse;
    coarse.grid.capsules_per_voxel = 20;
    EXPECT_LT(gpu::pack_geometry(scene.cloths, coarse, &cache).entries.size(),
              first.entries.size());
  }
  const Scene other = four_pieces(true);
  static_cast<void>(cache.grid_of(other.cloths[0]->fabric(), {}));
  EXPECT_EQ(cache.size(), 1U);
}

TEST_F(EyeRays, GoOnWhereOneRoundDoesNotSuffice) {
  Scene scene;
  FlatPlacement swatch;
  swatch.size_mm = {1200, 1};
  // Rays run between its fibres, along them, and meet nothing for more than a metre.
  scene.cloths.push_back(
      make_flat_cloth(test::fabric_of(test::crossed_layers(1, 4, 0.05f, 8)), swatch));
  const auto upright = [](glm::dvec2 p) { return glm::dvec3(640, p.y, p.x); };
  scene.cloths.push_back(test::shell_of(test::fabric_of(test::crossed_layers(4, 12, 0.05f, 2)),
                                        test::sheet(3, 3, upright)));
  Camera::View view;
  view.position_mm = {-640, 0, 0};
  view.look_at_mm = {0, 0, 0};
  view.up = {0, 0, 1};
  view.perspective = false;
  view.height = 0.6;
  scene.camera = Camera(view, static_cast<double>(kWidth) / kHeight);
  const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
  const gpu::DeviceGeometry geometry(*device_, arrays);
  const gpu::EyeBatch batch{0, kHeight / 2 - 8, kWidth, 16, 0, 1};
  gpu::EyeRays rays(*device_, geometry, view_of(scene), batch.rays());
  int swatches = 0;
  int beyond = 0;
  int through = 0;  // from end to end of the swatch
  const std::vector<DeviceHit> hits = followed(rays, batch);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const bool on_fibre = hits[i].fate == shading::kHitFibre;
    swatches += on_fibre && hits[i].cloth == 0 ? 1 : 0;
    beyond += on_fibre && hits[i].cloth == 1 ? 1 : 0;
    const std::size_t row = i / kWidth;
    through += on_fibre && hits[i].cloth == 1 && row >= 4 && row < 12 ? 1 : 0;
  }
  EXPECT_GT(swatches, 100);
  EXPECT_GT(beyond, 400);
  EXPECT_GT(through, 100);
}

TEST_F(EyeRays, GeometryThatDoesNotFitIsRefusedWithFigures) {
  const Scene scene = four_pieces(true);
  gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
  EXPECT_GT(arrays.size_bytes(), arrays.capsules.size() * sizeof(shading::DeviceCapsule));
  gpu::GridSettings settings;
  settings.most_bytes = arrays.size_bytes() / 8;
  const gpu::FabricGrid coarse = gpu::build_fabric_grid(scene.cloths[0]->fabric().tile(), settings);
  EXPECT_LE(coarse.size_bytes(), settings.most_bytes);
  settings.most_bytes = 100;
  try {
    static_cast<void>(gpu::build_fabric_grid(scene.cloths[0]->fabric().tile(), settings));
    FAIL() << "a grid of 100 bytes";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
    EXPECT_THAT(error.what(), testing::HasSubstr("fibre segments"));
  }
  arrays.entries.resize(device_->info().max_buffer_bytes / sizeof(std::uint32_t) + 1);
  const std::uint64_t used = device_->used_bytes();
  try {
    const gpu::DeviceGeometry geometry(*device_, arrays);
    FAIL() << "a buffer larger than a binding";
  } catch (const core::Error& error) {
    EXPECT_EQ(error.code(), core::Code::kResourceExhausted);
    EXPECT_THAT(error.what(), testing::HasSubstr("MiB"));
  }
  EXPECT_EQ(device_->used_bytes(), used);
}

}  // namespace
}  // namespace weft::render
