// Follows the same eye rays by the CPU's scenes on one thread, by the kernels' text compiled as C++
// on one thread, and by the kernel on a device, and prints a row of a Markdown table for each
// fabric, flat and draped: CPU time of all threads for a million rays (docs/performance.md). Usage:
// bench_eye_rays MESH.obj FABRIC...

#include "render/gpu/eye_rays.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/random.h"
#include "render/draw.h"
#include "render/flat_cloth.h"
#include "render/load_fabric.h"
#include "render/obj_mesh.h"
#include "render/scene.h"
#include "render/shell_cloth.h"

namespace weft::render {
namespace {

constexpr std::uint32_t kSide = 256;  // pixels
constexpr std::uint32_t kSamples = 4;
constexpr double kMillions = kSide * kSide * kSamples * 1e-6;
constexpr double kDrapedMm = 30;  // width of the draped cloth

// Seconds of all threads for a million rays.
template <class Work>
double cpu_seconds(const Work& work) {
  const std::clock_t start = std::clock();
  work();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / kMillions;
}

Scene flat_scene(const std::shared_ptr<const Fabric>& fabric) {
  Scene scene;
  FlatPlacement placement;
  placement.size_mm = 4.0 * glm::dvec2(fabric->tile().size_mm);
  placement.black_underlay = true;
  scene.cloths.push_back(make_flat_cloth(fabric, placement));
  return scene;
}

Scene draped_scene(const std::shared_ptr<const Fabric>& fabric, ObjMesh mesh) {
  Scene scene;
  double low = 1e30;
  double high = -1e30;
  for (const glm::dvec3& point : mesh.points) {
    low = std::min(low, point.x);
    high = std::max(high, point.x);
  }
  for (glm::dvec3& point : mesh.points) {
    point *= kDrapedMm / (high - low);
  }
  ShellPlacement placement;
  placement.black_underlay = true;
  scene.cloths.push_back(make_shell_cloth(fabric, mesh, placement, scene.remarks));
  return scene;
}

// The whole piece from aslant.
void look_at(Scene& scene) {
  const Cloth::Bounds bounds = scene.cloths.front()->bounds();
  const glm::dvec3 size = bounds.high_mm - bounds.low_mm;
  Camera::View view;
  view.look_at_mm = 0.5 * (bounds.low_mm + bounds.high_mm);
  view.position_mm =
      view.look_at_mm + 4.0 * std::max(size.x, size.y) * glm::normalize(glm::dvec3(0.2, -0.75, 1));
  view.up = {0, 0, 1};
  view.height = 0.25;
  scene.camera = Camera(view, 1.0);
}

struct Seen {
  int fate = 0;
  int segment = -1;
  float t_mm = 0;
};

Seen seen_of(const shading::DeviceHit& hit) { return {hit.fate, hit.segment, hit.t_mm}; }

// Share of rays that see another fibre; two segments of one fibre share the sphere between them.
double differing(const std::vector<Seen>& a, const std::vector<Seen>& b) {
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool near = std::fabs(a[i].t_mm - b[i].t_mm) < 1e-4f;
    different += a[i].fate != b[i].fate || (a[i].segment != b[i].segment && !near) ? 1 : 0;
  }
  return static_cast<double>(different) / static_cast<double>(a.size());
}

std::vector<Seen> by_scene(const Scene& scene, std::uint64_t seed) {
  std::vector<Seen> seen;
  const std::uint64_t derived = core::derive_seed(seed, kPurposeOfEyeRays);
  for (std::uint32_t i = 0; i < kSide * kSide * kSamples; ++i) {
    const std::uint32_t pixel = i / kSamples;
    core::Random random(derived, pixel, i % kSamples);
    const double dx = random.uniform_double();
    const double dy = random.uniform_double();
    const Ray ray = scene.camera.ray({(pixel % kSide + dx) / kSide, (pixel / kSide + dy) / kSide});
    const SceneMeeting meeting = closest(scene, ray, kInfinity, nullptr);
    Seen one;
    one.t_mm = shading::kFarMm;
    if (meeting.fate != Fate::kNothing) {
      const bool fibre = meeting.fate == Fate::kFibre;
      one = {fibre ? shading::kHitFibre : shading::kHitAbsorbed,
             fibre ? static_cast<int>(meeting.hit.fibre.segment) : -1,
             static_cast<float>(meeting.t_mm)};
    }
    seen.push_back(one);
  }
  return seen;
}

std::vector<Seen> by_text(const gpu::GeometryArrays& arrays, const gpu::EyeView& view,
                          const gpu::EyeBatch& batch) {
  const auto cloths = static_cast<int>(arrays.cloths.size());
  const shading::EyeTask task = gpu::eye_task(view, batch, cloths);
  std::vector<Seen> seen;
  for (int i = 0; i < static_cast<int>(batch.rays()); ++i) {
    const shading::EyeRay ray = shading::eye_ray(task, i);
    shading::EyeProgress progress = shading::eye_begin(ray);
    while (progress.search.cloth < cloths) {
      progress = shading::eye_on(&arrays, cloths, ray, progress, task.nearest_samples);
    }
    seen.push_back(seen_of(progress.hit));
  }
  return seen;
}

std::vector<Seen> by_device(gpu::Device& device, gpu::EyeRays& rays, const gpu::EyeBatch& batch) {
  static_cast<void>(rays.follow(batch));
  std::vector<Seen> seen;
  for (const shading::DeviceHit& hit :
       device.download<shading::DeviceHit>(rays.hits(), batch.rays())) {
    seen.push_back(seen_of(hit));
  }
  return seen;
}

void print_row(gpu::Device& device, const std::string& name, const char* shape, Scene scene) {
  look_at(scene);
  gpu::GeometrySettings settings;
  settings.nearest_volume = true;
  gpu::GeometryArrays arrays;
  const double build = cpu_seconds([&] { arrays = gpu::pack_geometry(scene.cloths, settings); });
  const gpu::DeviceGeometry geometry(device, arrays);
  gpu::EyeView view;
  view.camera = scene.camera;
  view.width = view.height = kSide;
  const gpu::EyeBatch batch{0, 0, kSide, kSide, 0, kSamples};
  std::vector<Seen> traced;
  std::vector<Seen> text;
  std::vector<Seen> kernel;
  const double scene_s = cpu_seconds([&] { traced = by_scene(scene, view.seed); });
  const double text_s = cpu_seconds([&] { text = by_text(arrays, view, batch); });
  gpu::EyeRays rays(device, geometry, view, batch.rays());
  kernel = by_device(device, rays, batch);  // compiles the kernel
  const double kernel_s = cpu_seconds([&] { kernel = by_device(device, rays, batch); });
  std::printf("| %s, %s | %.2f | %.2f | %.2f | %.4f %% | %.4f %% |", name.c_str(), shape, scene_s,
              text_s, kernel_s, 100 * differing(text, traced), 100 * differing(kernel, traced));
  for (const std::uint32_t samples : {32U, 64U, 128U}) {
    view.nearest_samples = samples;
    gpu::EyeRays nearest(device, geometry, view, batch.rays());
    std::printf(" %.1f %% |", 100 * differing(by_device(device, nearest, batch), traced));
  }
  const double fibres =
      static_cast<double>(std::count_if(traced.begin(), traced.end(), [](const Seen& one) {
        return one.fate == shading::kHitFibre;
      }));
  std::printf(" %.0f %% | %.1f | %.2f |\n", 100 * fibres / static_cast<double>(traced.size()),
              static_cast<double>(arrays.size_bytes() - arrays.nearest.size() * 4) / (1 << 20),
              build * kMillions);
  std::fflush(stdout);
}

int bench(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: bench_eye_rays MESH.obj FABRIC...\n");
    return 2;
  }
  const ObjMesh mesh = read_obj(argv[1]);
  const auto device = gpu::Device::open();
  std::printf(
      "| fabric | hierarchy, s | C++, s | %s, s | C++ differs | kernel differs | 32 | 64 | 128 "
      "samples differ | fibres seen | MiB | built in, s |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      device->info().name.c_str());
  for (int i = 2; i < argc; ++i) {
    const LoadedFabric fabric = load_fabric(argv[i], Fabric::Wanted::kFibres);
    print_row(*device, fabric.name, "flat", flat_scene(fabric.fabric));
    print_row(*device, fabric.name, "draped", draped_scene(fabric.fabric, mesh));
  }
  return 0;
}

}  // namespace
}  // namespace weft::render

int main(int argc, char** argv) {
  try {
    return weft::render::bench(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
