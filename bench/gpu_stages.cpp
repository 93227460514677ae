// Draws a scene on a device and prints for each stage what it took: time, bytes and operations,
// against the copy bandwidth and the multiply-add rate of the device, measured in the same run.
// Usage: bench_gpu_stages DATABASE.h5 [--scene SCENE] [--size WxH] [--spp N] [--device DEVICE]

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>

#include "bench/device_rates.h"
#include "bench/kernels/kernels.h"
#include "bench/stage_work.h"
#include "core/clock.h"
#include "render/build_scene.h"
#include "render/gpu/device_geometry.h"
#include "render/gpu/device_renderer.h"
#include "render/gpu/draw_on_device.h"
#include "render/gpu/eye_rays.h"
#include "render/load_fabric.h"
#include "render/scene_description.h"

namespace weft::bench {
namespace {

namespace gpu = render::gpu;

constexpr int kRepetitions = 5;           // of which the best counts
constexpr std::uint32_t kProbeSide = 64;  // rays whose work is counted and whose shadows are timed

struct Options {
  std::string database;
  std::string scene;
  std::string device;
  std::uint32_t width = 256;
  std::uint32_t height = 256;
  std::uint32_t samples = 4;
};

// One row of the table.
struct Stage {
  std::string name;
  double seconds = 0;
  double items = 0;
  Work per_item;
};

// Shadow rays of a small picture of the scene, and the work of its eye rays.
struct Probe {
  Work eye_ray;
  Work shadow_ray;
  double shadow_ray_seconds = 0;  // of one
};

GeometryView view_of(const gpu::GeometryArrays& a) {
  return {a.cloths, a.tetrahedra, a.shell_triangles, a.nodes,    a.outer_faces, a.fabrics,
          a.bricks, a.voxels,     a.entries,         a.capsules, a.segments,    a.patterns};
}

double time_shadow_rays(gpu::Device& device, const gpu::DeviceGeometry& geometry,
                        const gpu::Buffer& hits, std::uint32_t count, glm::vec3 to_light) {
  struct {
    glm::vec3 to_light;
    std::uint32_t count;
    std::int32_t cloths;
  } push{to_light, count, geometry.cloths()};
  std::vector<const gpu::Buffer*> buffers = geometry.solid_buffers();
  const gpu::Buffer blocked = device.allocate(std::uint64_t{count} * 4, "what is in shadow");
  buffers.insert(buffers.end(), {&hits, &blocked});
  const gpu::Kernel kernel = device.make_kernel(
      kernels::shadow_rays, static_cast<std::uint32_t>(buffers.size()), sizeof(push));
  const gpu::Dispatch dispatch{.kernel = &kernel,
                               .buffers = buffers,
                               .push = gpu::push_constants(push),
                               .groups_x = (count + 63) / 64};
  double best_ns = device.run({&dispatch, 1}).front();
  for (int i = 0; i < 4; ++i) {
    best_ns = std::min(best_ns, device.run({&dispatch, 1}).front());
  }
  return best_ns * 1e-9;
}

Probe probe(gpu::Device& device, const render::Scene& scene) {
  const gpu::GeometryArrays arrays = gpu::pack_geometry(scene.cloths);
  const gpu::DeviceGeometry geometry(device, arrays);
  const gpu::EyeView view{scene.camera, kProbeSide, kProbeSide, 1, 0};
  const gpu::EyeBatch batch{0, 0, kProbeSide, kProbeSide, 0, 1};
  gpu::EyeRays eye(device, geometry, view, batch.rays());
  (void)eye.follow(batch);
  const auto count = static_cast<std::uint32_t>(batch.rays());
  const auto hits = device.download<shading::DeviceHit>(eye.hits(), count);

  const shading::EyeTask task = gpu::eye_task(view, batch, geometry.cloths());
  std::vector<WorldRay> rays;
  double met = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const shading::EyeRay ray = shading::eye_ray(task, static_cast<int>(i));
    rays.push_back({ray.origin_mm, ray.direction});
    met += hits[i].fate == shading::kHitFibre ? 1 : 0;
  }
  Probe found;
  found.eye_ray = eye_ray_work(view_of(arrays), rays);
  const glm::vec3 to_light = glm::normalize(glm::vec3(-0.5F, 0.3F, 0.8F));
  found.shadow_ray = shadow_ray_work(view_of(arrays), hits, to_light);
  found.shadow_ray_seconds =
      met > 0 ? time_shadow_rays(device, geometry, eye.hits(), count, to_light) / met : 0;
  return found;
}

// Counted by hand in the shared text, for a fabric with so many Gaussians and harmonics: what a hit
// reads and computes under one Gaussian light, without its shadow rays.
Work gaussian_light_work(double gaussians, double harmonics) {
  constexpr double kProductOperations = 40;  // turn of the axis, product, weight
  constexpr double kGammaOperations = 300;   // both lobes in closed form
  constexpr double kGammaBytes = 4 * 8;      // entries of the lobes' tables
  constexpr double kSampleBytes = 2 * 32;
  const double arriving = 3 * harmonics * 4;  // read, added to and written, and the cell's light
  return {84 + kSampleBytes + gaussians * (2 + 12 + kGammaBytes) + 3 * arriving,
          300 + gaussians * (kProductOperations + kGammaOperations) + 6 * harmonics};
}

// ..., under a light of one drawn direction: its harmonics and the BCSDF.
Work drawn_light_work(double harmonics) {
  return {84 + 64 + 2 * 16 + 3 * harmonics * 4 * 2, 400 + 12 * harmonics};
}

// C_S between two rows, turned, times what arrives.
Work multiple_work(double harmonics) {
  constexpr double kTurnOperations = 3 * 120 + 2 * 116;
  return {84 + 12 + 3 * harmonics * 4 * 3, 60 + 3 * (5 * harmonics + kTurnOperations)};
}

// A matrix of halves times a vector, for each channel.
Work cell_work(double harmonics) {
  const double entries = 3 * harmonics * harmonics;
  return {2 * entries, 2 * entries};
}

void print(const std::vector<Stage>& stages, const DeviceRates& rates) {
  std::printf("| stage | ms | items | ns each | GB/s | of copying | Gop/s | of multiply-adds |\n");
  std::printf("|---|---:|---:|---:|---:|---:|---:|---:|\n");
  for (const Stage& stage : stages) {
    if (stage.items <= 0 || stage.seconds <= 0) {
      continue;
    }
    const double bytes_per_s = stage.items * stage.per_item.bytes / stage.seconds;
    const double operations_per_s = stage.items * stage.per_item.operations / stage.seconds;
    std::printf("| %s | %.2f | %.0f | %.1f | %.2f | %.0f %% | %.2f | %.0f %% |\n",
                stage.name.c_str(), 1e3 * stage.seconds, stage.items,
                1e9 * stage.seconds / stage.items, 1e-9 * bytes_per_s,
                100 * bytes_per_s / rates.copy_bytes_per_s, 1e-9 * operations_per_s,
                100 * operations_per_s / rates.operations_per_s);
  }
}

int run(const Options& options) {
  v1::Scene described =
      options.scene.empty() ? render::default_scene() : render::load_scene(options.scene);
  described.mutable_picture()->set_width(options.width);
  described.mutable_picture()->set_height(options.height);
  described.mutable_picture()->set_samples_per_pixel(options.samples);
  render::expand_picture_defaults(described);
  const render::LoadedFabric loaded =
      render::load_fabric(options.database, render::Fabric::Wanted::kFibresAndTransfer);
  const render::Scene scene =
      render::build_scene(described, [&](const std::string&) { return loaded.fabric; });
  gpu::DeviceRenderer renderer(options.device);
  gpu::Device& device = renderer.device();
  const DeviceRates rates = measure_rates(device);
  const Probe probed = probe(device, scene);

  gpu::DeviceDrawSettings settings;
  settings.picture.width = options.width;
  settings.picture.height = options.height;
  settings.picture.samples_per_pixel = options.samples;
  const auto draw = [&] {
    return gpu::draw_on_device(
        renderer, scene, settings, [](double) {}, [] { return false; });
  };
  (void)draw();  // compiles and uploads
  std::map<std::string, double> seconds;
  double wall_seconds = std::numeric_limits<double>::infinity();
  render::Drawing drawing;
  for (int i = 0; i < kRepetitions; ++i) {
    device.forget_kernel_times();
    const core::Stopwatch watch;
    drawing = draw();
    wall_seconds = std::min(wall_seconds, watch.seconds());
    for (const gpu::KernelTime& time : device.kernel_times()) {
      const auto [at, is_new] = seconds.try_emplace(time.name, 1e-9 * time.duration_ns);
      at->second = std::min(at->second, 1e-9 * time.duration_ns);
    }
  }
  double device_seconds = 0;
  for (const auto& [name, spent] : seconds) {
    device_seconds += spent;
  }
  const storage::FabricDatabase& db = loaded.fabric->precomputed()->database();
  const double harmonics = (db.sh_order + 1.0) * (db.sh_order + 1.0);
  const double rays = static_cast<double>(options.width) * options.height * options.samples;
  const double hits = drawing.cloth_share * rays;
  const double lights = static_cast<double>(scene.lights.size());
  const auto gaussian_lights = static_cast<double>(std::count_if(
      scene.lights.begin(), scene.lights.end(),
      [](const render::Light& light) { return std::holds_alternative<render::SgLight>(light); }));
  const double shadow_rays = 2 * lights * hits;  // one for each kind of scattering
  const double shadow_seconds = shadow_rays * probed.shadow_ray_seconds;
  std::printf("%s\n%s: %u x %u, %u samples a pixel, %.0f lights, %.1f %% of the rays meet fibres\n",
              device.info().name.c_str(), loaded.name.c_str(), options.width, options.height,
              options.samples, lights, 100 * drawing.cloth_share);
  std::printf("copies %.2f GB/s (read and written), multiply-adds %.2f Gop/s\n\n",
              1e-9 * rates.copy_bytes_per_s, 1e-9 * rates.operations_per_s);
  print({{"eye rays", seconds["eye_rays"], rays, probed.eye_ray},
         {"light to cells", seconds["light_cells"],
          lights * static_cast<double>(db.cell_paths.size()), cell_work(harmonics)},
         {"Gaussian lights", seconds["light_gaussian"], gaussian_lights * hits,
          gaussian_light_work(db.sg_count, harmonics)},
         {"drawn lights", seconds["light_drawn"], (lights - gaussian_lights) * hits,
          drawn_light_work(harmonics)},
         {"of both: shadow rays", shadow_seconds, shadow_rays, probed.shadow_ray},
         {"multiple scattering", seconds["multiple"], hits, multiple_work(harmonics)},
         {"sums", seconds["accumulate"], rays, {92 + 224.0 / options.samples, 60}}},
        rates);
  std::printf("\nkernels %.1f ms, all %.1f ms: %.2f million rays a second\n", 1e3 * device_seconds,
              1e3 * wall_seconds, 1e-6 * rays / wall_seconds);
  return 0;
}

}  // namespace
}  // namespace weft::bench

int main(int argc, char** argv) {
  weft::bench::Options options;
  CLI::App app{"Time, bytes and operations of each stage of drawing on a device."};
  app.add_option("database", options.database, "Fabric database (.h5)")->required();
  app.add_option("--scene", options.scene, "Scene (.textproto or .json)");
  app.add_option("--device", options.device, "Number or part of the name; default: the best");
  app.add_option("--width", options.width, "Pixels")->check(CLI::Range(1, 16384));
  app.add_option("--height", options.height, "Pixels")->check(CLI::Range(1, 16384));
  app.add_option("--spp", options.samples, "Samples per pixel")->check(CLI::Range(1, 4096));
  CLI11_PARSE(app, argc, argv);
  try {
    return weft::bench::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_gpu_stages: %s\n", error.what());
    return 1;
  }
}
