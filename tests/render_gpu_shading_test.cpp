#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render/flat_cloth.h"
#include "render/gpu/device.h"
#include "render/gpu/geometry.h"
#include "render/gpu/lights.h"
#include "render/gpu/shading_pass.h"
#include "render/kernels/hit.h"
#include "render/precomputed_integrator.h"
#include "tests/render_random_fabric.h"

// Light on the device against light on the CPU, on the same eye rays: those of the CPU.

namespace weft::render::gpu {
namespace {

constexpr std::uint32_t kSide = 24;
constexpr std::uint64_t kSeed = 11;

struct TestDevice {
  std::unique_ptr<Device> device = Device::open({}, {Validation::kOn, false});
  ShadingKernels kernels{*device};
};

TestDevice& test_device() {
  static TestDevice made;
  return made;
}

Scene flat_scene(const std::shared_ptr<const Fabric>& fabric, std::vector<Light> lights) {
  Scene scene;
  FlatPlacement placement;
  placement.size_mm = {6, 6};
  placement.turn = 0.4;
  scene.cloths.push_back(make_flat_cloth(fabric, placement));
  Camera::View view;
  view.position_mm = {2, -3, 6};
  view.look_at_mm = {0, 0, 0};
  view.up = {0, 1, 0};
  view.perspective = false;
  view.height = 2.5;
  scene.camera = Camera(view, 1.0);
  scene.lights = std::move(lights);
  return scene;
}

shading::DeviceHit device_hit(const SceneMeeting& meeting, const Ray& ray) {
  shading::DeviceHit hit{};
  hit.fate = meeting.fate == Fate::kFibre     ? shading::kHitFibre
             : meeting.fate == Fate::kNothing ? shading::kHitNothing
                                              : shading::kHitAbsorbed;
  hit.cloth = static_cast<int>(meeting.hit.cloth);
  hit.place = static_cast<int>(meeting.hit.fibre.place);
  hit.segment = static_cast<int>(meeting.hit.fibre.segment);
  hit.t_mm = static_cast<float>(meeting.t_mm);
  hit.world_mm = meeting.hit.fibre.world_mm;
  hit.flat_mm = meeting.hit.fibre.flat_mm;
  hit.to_eye = -ray.direction;
  return hit;
}

// Both ways of shading the same eye rays, sample by sample.
struct Shaded {
  std::vector<EyeSample> cpu;
  std::vector<shading::DeviceSample> device;
  std::vector<shading::DevicePixel> pixels;
};

Shaded shade_twice(const Scene& scene, Scattering scattering, std::uint32_t samples) {
  const std::uint32_t pixels = kSide * kSide;
  Shaded shaded;
  std::vector<shading::DeviceHit> hits;
  const PrecomputedIntegrator integrator(scene, scattering);
  const GeometryArrays geometry = pack_geometry(scene.cloths);
  for (std::uint32_t pixel = 0; pixel < pixels; ++pixel) {
    for (std::uint32_t sample = 0; sample < samples; ++sample) {
      core::Random random(kSeed, pixel, sample);
      const double dx = random.uniform_double();
      const double dy = random.uniform_double();
      const Ray ray =
          scene.camera.ray({(pixel % kSide + dx) / kSide, (pixel / kSide + dy) / kSide});
      const SceneMeeting meeting = closest(scene, ray, kInfinity, nullptr);
      hits.push_back(device_hit(meeting, ray));
      if (meeting.fate == Fate::kFibre) {
        hits.back().fabric = geometry.cloths[meeting.hit.cloth].fabric;
      }
      shaded.cpu.push_back(integrator.trace(ray, random));
    }
  }
  TestDevice& with = test_device();
  Device& device = *with.device;
  std::vector<DeviceFabricTables> tables;
  for (const Fabric* fabric : geometry.sources) {
    tables.emplace_back(device, pack_fabric(*fabric));
  }
  const std::vector<Buffer> solid = [&] {
    std::vector<Buffer> buffers;
    buffers.push_back(device.upload(geometry.cloths, "cloths"));
    buffers.push_back(device.upload(geometry.tetrahedra, "tetrahedra"));
    buffers.push_back(device.upload(geometry.shell_triangles, "triangles"));
    buffers.push_back(device.upload(geometry.nodes, "nodes"));
    buffers.push_back(device.upload(geometry.outer_faces, "faces"));
    return buffers;
  }();
  ShadingPass::Parts parts;
  parts.kernels = &with.kernels;
  for (const Buffer& buffer : solid) {
    parts.solid.push_back(&buffer);
  }
  parts.cloths = static_cast<int>(scene.cloths.size());
  for (std::size_t cloth = 0; cloth < scene.cloths.size(); ++cloth) {
    const int fabric = geometry.cloths[cloth].fabric;
    parts.pieces.push_back({static_cast<int>(cloth), fabric,
                            &tables[static_cast<std::size_t>(fabric)],
                            scene.cloths[cloth]->constant_rotation().has_value(),
                            scene.cloths[cloth]->fabric().precomputed()->settings()});
  }
  parts.lights = device_lights(scene.lights);
  ShadingSettings settings;
  settings.scattering = scattering;
  ShadingPass pass(device, parts, settings);
  pass.prepare([] { return false; });
  BatchBuffers buffers(device, pixels * samples, pixels, 36);
  device.fill_zero(buffers.pixels);
  const Buffer uploaded = device.upload(hits, "hits");
  shading::Batch batch{};
  batch.seed = {static_cast<std::uint32_t>(kSeed), 0};
  batch.width = batch.columns = batch.rows = static_cast<int>(kSide);
  batch.sample_count = static_cast<int>(samples);
  batch.capacity = buffers.capacity;
  std::vector<Dispatch> dispatches;
  pass.append(batch, uploaded, buffers, dispatches);
  device.run(dispatches);
  shaded.device = device.download<shading::DeviceSample>(buffers.samples, hits.size());
  shaded.pixels = device.download<shading::DevicePixel>(buffers.pixels, pixels);
  return shaded;
}

// The share of samples whose radiance differs by more than `tolerance` of the brightest.
double share_apart(const Shaded& shaded, double tolerance) {
  double brightest = 0;
  for (const EyeSample& sample : shaded.cpu) {
    brightest = std::max(brightest, static_cast<double>(glm::length(sample.radiance)));
  }
  EXPECT_GT(brightest, 1e-3);
  double apart = 0;
  for (std::size_t i = 0; i < shaded.cpu.size(); ++i) {
    if (!shaded.cpu[i].on_cloth) {
      continue;
    }
    const glm::vec3 seen = shaded.device[i].single + shaded.device[i].multiple;
    const auto difference = static_cast<double>(glm::length(seen - shaded.cpu[i].radiance));
    apart += difference <= tolerance * brightest ? 0 : 1;
  }
  return apart / static_cast<double>(shaded.cpu.size());
}

const glm::dvec3 kTowards = glm::normalize(glm::dvec3(-0.3, 0.4, 1));

TEST(DeviceShading, AgreesSampleBySampleWithTheCpuUnderLightsThatNeedNoChance) {
  const auto fabric = random_fabric({});
  const std::vector<std::vector<Light>> cases = {
      {DirectionalLight{kTowards, {1, 2, 3}}},
      {SgLight{kTowards, 30, {1, 2, 3}}},
      {SgLight{kTowards, 150, {1, 2, 3}}},
      {SgLight{kTowards, 900, {1, 2, 3}}},
      {DirectionalLight{kTowards, {1, 2, 3}}, SgLight{{0, 0, 1}, 20, {2, 2, 2}},
       SgLight{glm::normalize(glm::dvec3(1, 0, 0.4)), 3000, {5, 1, 2}}}};
  for (const std::vector<Light>& lights : cases) {
    for (const Scattering scattering :
         {Scattering::kAll, Scattering::kSingleOnly, Scattering::kMultipleOnly}) {
      const Shaded shaded = shade_twice(flat_scene(fabric, lights), scattering, 2);
      // Signed distances are halves: a light at their edge may be seen on one side alone.
      EXPECT_LT(share_apart(shaded, 2e-3), 0.01) << lights.size();
    }
  }
  EXPECT_TRUE(test_device().device->complaints().empty());
}

}  // namespace
}  // namespace weft::render::gpu
