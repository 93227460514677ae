#include "render/gpu/draw_on_device.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>

#include "core/check.h"
#include "core/clock.h"
#include "core/error.h"
#include "render/gpu/device_geometry.h"
#include "render/gpu/device_sums.h"
#include "render/gpu/eye_rays.h"
#include "render/gpu/lights.h"

namespace weft::render::gpu {
namespace {

using shading::Batch;

// Of one submission. The first batch is small, for nothing is known yet.
constexpr double kWantedNs = 15e6;
constexpr std::uint64_t kFirstRays = 2048;
constexpr std::uint64_t kFewestRays = 64;
// More samples of one pixel than this are one after the other in accumulate.comp.
constexpr std::uint64_t kMostSamplesAtOnce = 16;

// What suits a processor's caches, and what keeps a GPU busy.
constexpr std::uint64_t kMostRaysInSoftware = 16384;
constexpr std::uint64_t kMostRaysOnGpu = 1U << 20;
constexpr std::uint64_t kMostPixelsInSoftware = 65536;
constexpr std::uint64_t kMostPixelsOnGpu = 1U << 20;

std::uint64_t most_rays_of(const DeviceDrawSettings& settings, const DeviceInfo& info,
                           std::uint32_t harmonics) {
  std::uint64_t most =
      info.kind == DeviceInfo::Kind::kSoftware ? kMostRaysInSoftware : kMostRaysOnGpu;
  if (settings.most_rays > 0) {
    most = settings.most_rays;
  }
  const std::uint64_t bytes = std::uint64_t{3} * harmonics * sizeof(float);
  most = std::min(most, info.max_buffer_bytes / std::max<std::uint64_t>(bytes, 1));
  const std::uint64_t rays =
      std::uint64_t{settings.picture.width} * settings.picture.height *
      std::min<std::uint64_t>(settings.picture.samples_per_pixel, kMostSamplesAtOnce);
  return std::clamp<std::uint64_t>(rays, 1, most);
}

std::uint32_t band_rows_of(const DeviceDrawSettings& settings, const DeviceInfo& info) {
  std::uint64_t most =
      info.kind == DeviceInfo::Kind::kSoftware ? kMostPixelsInSoftware : kMostPixelsOnGpu;
  if (settings.most_pixels > 0) {
    most = settings.most_pixels;
  }
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(most / settings.picture.width, 1, settings.picture.height));
}

EyeView eye_view_of(const Scene& scene, const DeviceDrawSettings& settings) {
  return {scene.camera, settings.picture.width, settings.picture.height, settings.picture.seed,
          settings.nearest_samples};
}

EyeBatch eye_batch_of(const Batch& batch) {
  EyeBatch eye;
  eye.left = static_cast<std::uint32_t>(batch.left);
  eye.top = static_cast<std::uint32_t>(batch.top);
  eye.columns = static_cast<std::uint32_t>(batch.columns);
  eye.rows = static_cast<std::uint32_t>(batch.rows);
  eye.first_sample = static_cast<std::uint32_t>(batch.first_sample);
  eye.sample_count = static_cast<std::uint32_t>(batch.sample_count);
  return eye;
}

[[noreturn]] void throw_cancelled() {
  throw core::Error(core::Code::kCancelled, "the picture was cancelled; nothing was written");
}

// What the pieces of a scene need of the device besides the tables of their fabrics.
struct Needs {
  std::uint32_t harmonics = 1;
  std::uint64_t cell_entries = 0;
};

// Adds what one fabric of a piece needs; light reaches the cells of level pieces once.
void add_needs(Needs& needs, const PrecomputedFabric* fabric, bool is_level) {
  CHECK(fabric != nullptr);
  const auto harmonics = static_cast<std::uint32_t>(fabric->tables().sizes.harmonics);
  needs.harmonics = std::max(needs.harmonics, harmonics);
  if (is_level) {
    needs.cell_entries += std::uint64_t{3} * harmonics * fabric->database().cell_paths.size();
  }
}

Needs needs_of(const Scene& scene, const GeometryArrays& geometry) {
  Needs needs;
  for (std::size_t cloth = 0; cloth < scene.cloths.size(); ++cloth) {
    const bool is_level = scene.cloths[cloth]->constant_rotation().has_value();
    for (const int index : geometry.fabrics_of(cloth)) {
      add_needs(needs, geometry.sources[static_cast<std::size_t>(index)]->precomputed(), is_level);
    }
  }
  return needs;
}

}  // namespace

// The scene in the device's memory.
struct DeviceDrawing::OnDevice {
  struct Sizes {
    std::uint64_t most_rays;
    std::uint32_t band_rows;
    std::uint32_t harmonics;
  };
  OnDevice(DeviceRenderer& renderer, const GeometryArrays& arrays, const EyeView& view,
           const Sizes& sizes, ShadingPass::Parts parts, const ShadingSettings& settings)
      : band_rows(sizes.band_rows),
        geometry(renderer.device(), arrays),
        eye_rays(renderer.device(), geometry, view, sizes.most_rays, &renderer.eye_kernel()),
        buffers(renderer.device(), static_cast<std::uint32_t>(sizes.most_rays),
                sizes.band_rows * view.width, sizes.harmonics),
        shading(renderer.device(), with_solid(std::move(parts), geometry), settings),
        seed(eye_task(view, {}, geometry.cloths()).seed) {}

  static ShadingPass::Parts with_solid(ShadingPass::Parts parts, const DeviceGeometry& geometry) {
    parts.solid = geometry.solid_buffers();
    parts.cloths = geometry.cloths();
    return parts;
  }

  std::uint32_t band_rows;
  DeviceGeometry geometry;
  EyeRays eye_rays;
  BatchBuffers buffers;
  ShadingPass shading;
  glm::uvec2 seed;
};

// Rows of the picture whose sums the device holds at once, and the samples to add to them.
struct DeviceDrawing::Band {
  std::uint32_t top;
  std::uint32_t rows;
  std::uint32_t first_sample;
  std::uint32_t sample_count;
};

DeviceDrawing::DeviceDrawing(DeviceRenderer& renderer, const Scene& scene,
                             const DeviceDrawSettings& settings)
    : renderer_(renderer), scene_(scene), settings_(settings) {
  const DrawSettings& picture = settings.picture;
  CHECK(picture.width > 0 && picture.height > 0 && picture.samples_per_pixel > 0);
  CHECK(picture.width <= kImageSideLimit && picture.height <= kImageSideLimit);
  pixels_.resize(static_cast<std::size_t>(picture.width) * picture.height);
  put_on_device();
}

DeviceDrawing::~DeviceDrawing() = default;

void DeviceDrawing::put_on_device() {
  on_device_.reset();
  const DeviceInfo& info = renderer_.info();
  GeometrySettings grid;
  grid.nearest_volume = settings_.nearest_samples > 0;
  const GeometryArrays geometry = pack_geometry(scene_.cloths, grid, &renderer_.grids());
  fabrics_ = geometry.sources;
  const Needs needs = needs_of(scene_, geometry);
  const OnDevice::Sizes sizes{most_rays_of(settings_, info, needs.harmonics),
                              band_rows_of(settings_, info), needs.harmonics};
  ShadingPass::Parts parts;
  parts.kernels = &renderer_.kernels();
  parts.lights = device_lights(scene_.lights);
  const std::vector<const DeviceFabricTables*> tables = renderer_.tables_of(
      fabrics_, geometry.size_bytes() + EyeRays::size_bytes(sizes.most_rays) +
                    BatchBuffers::size_bytes(
                        sizes.most_rays, std::uint64_t{sizes.band_rows} * settings_.picture.width,
                        sizes.harmonics) +
                    ShadingPass::cell_bytes(needs.cell_entries, parts.lights));
  for (std::size_t cloth = 0; cloth < scene_.cloths.size(); ++cloth) {
    for (const int fabric : geometry.fabrics_of(cloth)) {
      const auto index = static_cast<std::size_t>(fabric);
      parts.pieces.push_back(
          {static_cast<int>(cloth), fabric, tables[index],
           scene_.cloths[cloth]->constant_rotation().has_value(),
           settings_.shading.value_or(fabrics_[index]->precomputed()->settings())});
    }
  }
  on_device_ = std::make_unique<OnDevice>(
      renderer_, geometry, eye_view_of(scene_, settings_), sizes, std::move(parts),
      ShadingSettings{settings_.scattering, settings_.picture.layers.has(Layer::kShadow)});
  rays_at_once_ = std::min(kFirstRays, sizes.most_rays);
}

// Follows the eye rays of a batch, shades what they hit, and learns from the time it took.
void DeviceDrawing::draw_batch(const Batch& batch) {
  const core::Stopwatch watch;
  double ns = on_device_->eye_rays.follow(eye_batch_of(batch));
  std::vector<Dispatch> dispatches;
  on_device_->shading.append(batch, on_device_->eye_rays.hits(), on_device_->buffers, dispatches);
  const std::vector<double> spent_ns = renderer_.device().run(dispatches);
  ns += std::accumulate(spent_ns.begin(), spent_ns.end(), 0.0);
  if (!(ns > 0)) {
    ns = watch.seconds() * 1e9;
  }
  // Small batches do not say what large ones take.
  const double rays = static_cast<double>(rays_at_once_) * std::clamp(kWantedNs / ns, 0.5, 2.0);
  if (rays < static_cast<double>(rays_at_once_) ||
      2 * std::uint64_t{shading::batch_items(batch)} > rays_at_once_) {
    rays_at_once_ = std::clamp(static_cast<std::uint64_t>(rays),
                               std::min<std::uint64_t>(kFewestRays, on_device_->buffers.capacity),
                               std::uint64_t{on_device_->buffers.capacity});
  }
}

// The sums of a band are those of the host until the whole band is drawn.
void DeviceDrawing::draw_band(const Band& band, const std::function<void(double)>& progress,
                              const std::function<bool()>& should_stop) {
  Device& device = renderer_.device();
  const std::uint32_t width = settings_.picture.width;
  const std::span<shading::DevicePixel> sums(pixels_.data() + std::size_t{band.top} * width,
                                             std::size_t{band.rows} * width);
  device.write(on_device_->buffers.pixels, 0, std::as_bytes(sums));
  const std::uint32_t bottom = band.top + band.rows;
  std::uint32_t left = 0;
  for (std::uint32_t top = band.top; top < bottom;) {
    const auto samples = static_cast<std::uint32_t>(
        std::min({std::uint64_t{band.sample_count}, kMostSamplesAtOnce, rays_at_once_}));
    const std::uint64_t pixels = std::max<std::uint64_t>(rays_at_once_ / samples, 1);
    const bool whole_rows = left == 0 && pixels >= width;
    const std::uint32_t columns =
        whole_rows ? width
                   : static_cast<std::uint32_t>(std::min<std::uint64_t>(width - left, pixels));
    const std::uint32_t rows =
        whole_rows
            ? static_cast<std::uint32_t>(std::min<std::uint64_t>(bottom - top, pixels / width))
            : 1;
    Batch batch{};
    batch.seed = on_device_->seed;
    batch.width = static_cast<int>(width);
    batch.band_top = static_cast<int>(band.top);
    batch.left = static_cast<int>(left);
    batch.top = static_cast<int>(top);
    batch.columns = static_cast<int>(columns);
    batch.rows = static_cast<int>(rows);
    batch.capacity = on_device_->buffers.capacity;
    for (std::uint32_t done = 0; done < band.sample_count; done += samples) {
      if (should_stop()) {
        throw_cancelled();
      }
      batch.first_sample = static_cast<int>(band.first_sample + done);
      batch.sample_count = static_cast<int>(std::min(samples, band.sample_count - done));
      draw_batch(batch);
    }
    left = left + columns == width ? 0 : left + columns;
    top += left == 0 ? rows : 0;
    progress((top - band.top + static_cast<double>(left) / width) / band.rows);
  }
  std::vector<shading::DevicePixel> drawn =
      device.download<shading::DevicePixel>(on_device_->buffers.pixels, sums.size());
  std::copy(drawn.begin(), drawn.end(), sums.begin());
}

void DeviceDrawing::add_samples(std::uint32_t count, const std::function<void(double)>& progress,
                                const std::function<bool()>& should_stop) {
  const std::uint32_t height = settings_.picture.height;
  for (std::uint32_t top = 0; top < height;) {
    const std::uint32_t rows = std::min(on_device_->band_rows, height - top);
    try {
      on_device_->shading.prepare(should_stop);
      draw_band(
          {top, rows, samples_, count},
          [&](double share) { progress((top + share * rows) / height); }, should_stop);
      top += rows;
    } catch (const core::Error& error) {
      if (error.code() != core::Code::kUnavailable || was_lost_) {
        throw;
      }
      was_lost_ = true;
      on_device_.reset();
      renderer_.reopen();
      put_on_device();
    }
  }
  samples_ += count;
}

Drawing DeviceDrawing::drawing() const {
  std::vector<LayerSums> layers;
  if (!settings_.picture.layers.empty()) {
    layers = layer_sums(pixels_, scene_, fabrics_);
  }
  return drawing_of(settings_.picture, pixel_sums(pixels_, scene_.background, samples_), layers);
}

Drawing draw_on_device(DeviceRenderer& renderer, const Scene& scene,
                       const DeviceDrawSettings& settings,
                       const std::function<void(double)>& progress,
                       const std::function<bool()>& should_stop) {
  DeviceDrawing drawing(renderer, scene, settings);
  drawing.add_samples(settings.picture.samples_per_pixel, progress, should_stop);
  return drawing.drawing();
}

}  // namespace weft::render::gpu
