#include "render/draw.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <vector>

#include <glm/vec2.hpp>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"
#include "render/adaptive.h"
#include "render/pixel_sums.h"

namespace weft::render {
namespace {

void add_to_layers(LayerSums& sums, const EyeSample& seen, std::uint32_t sample) {
  sums.single += glm::dvec3(seen.single);
  sums.multiple += glm::dvec3(seen.multiple);
  sums.shadow += static_cast<double>(seen.shadow);
  if (sample == 0) {
    sums.segment = seen.segment;
    sums.cloth = seen.cloth;
    sums.tangent = seen.tangent;
    sums.normal = seen.normal;
  }
}

// Up to sample `end`. `layers` may be null.
void draw_pixel(const Camera& camera, const Integrator& integrator, const DrawSettings& settings,
                glm::uvec2 pixel, std::uint32_t end, PixelSums& sums, LayerSums* layers) {
  const std::uint64_t seed = core::derive_seed(settings.seed, kPurposeOfEyeRays);
  for (std::uint32_t sample = sums.samples; sample < end; ++sample) {
    core::Random random(seed, pixel.y * settings.width + pixel.x, sample);
    const double dx = random.uniform_double();
    const double dy = random.uniform_double();
    const EyeSample seen = integrator.trace(
        camera.ray({(pixel.x + dx) / settings.width, (pixel.y + dy) / settings.height}), random);
    const glm::dvec3 radiance(seen.radiance);
    ++sums.samples;
    sums.radiance += radiance;
    sums.squared += radiance * radiance;
    if (seen.on_cloth) {
      sums.cloth_radiance += radiance;
      sums.cloth_squared += radiance * radiance;
      ++sums.on_cloth;
    }
    if (layers != nullptr) {
      add_to_layers(*layers, seen, sample);
    }
  }
}

}  // namespace

struct GrowingDrawing::Sums {
  std::vector<PixelSums> pixels;
  std::vector<LayerSums> layers;       // empty when no layer is wanted
  std::vector<std::uint32_t> planned;  // samples in all; empty: of every pixel as many
};

GrowingDrawing::GrowingDrawing(const DrawSettings& settings)
    : settings_(settings), sums_(std::make_unique<Sums>()) {
  CHECK(settings.width > 0 && settings.height > 0 && settings.samples_per_pixel > 0);
  CHECK(settings.width <= kImageSideLimit && settings.height <= kImageSideLimit);
  const std::size_t count = static_cast<std::size_t>(settings.width) * settings.height;
  sums_->pixels.resize(count);
  if (!settings.layers.empty()) {
    sums_->layers.resize(count);
  }
}

GrowingDrawing::~GrowingDrawing() = default;

std::uint64_t GrowingDrawing::size_bytes(const DrawSettings& settings) {
  const std::uint64_t pixels = std::uint64_t{settings.width} * settings.height;
  constexpr std::uint64_t kImages = 2 * sizeof(glm::vec3);
  constexpr std::uint64_t kLayerPlanes = 4 * sizeof(glm::vec3) + 3 * sizeof(float);
  return pixels * (sizeof(PixelSums) + kImages +
                   (settings.layers.empty() ? 0 : sizeof(LayerSums) + kLayerPlanes));
}

void GrowingDrawing::plan_if_due() {
  if (settings_.target_error > 0 && samples_ == kPilotSamples &&
      settings_.samples_per_pixel > kPilotSamples) {
    sums_->planned = samples_by_pixel(
        sums_->pixels,
        {settings_.width, settings_.height, settings_.samples_per_pixel, settings_.target_error});
  }
}

void GrowingDrawing::add_samples(const Camera& camera, const Integrator& integrator,
                                 std::uint32_t count, const std::function<void(double)>& progress,
                                 const std::function<bool()>& should_stop) {
  const std::uint32_t end = samples_ + count;
  const bool has_pilot =
      settings_.target_error > 0 && samples_ < kPilotSamples && end > kPilotSamples;
  const double pilot = has_pilot ? static_cast<double>(kPilotSamples - samples_) / count : 0;
  if (has_pilot) {
    add_range(
        camera, integrator, kPilotSamples, [&](double share) { progress(share * pilot); },
        should_stop);
    plan_if_due();
  }
  add_range(
      camera, integrator, end, [&](double share) { progress(pilot + share * (1 - pilot)); },
      should_stop);
  plan_if_due();
}

void GrowingDrawing::add_range(const Camera& camera, const Integrator& integrator,
                               std::uint32_t end, const std::function<void(double)>& progress,
                               const std::function<bool()>& should_stop) {
  std::atomic<bool> stopped = false;
  std::mutex progress_mutex;
  std::uint32_t rows_done = 0;  // under progress_mutex
  const auto draw_row = [&](std::uint32_t y) {
    for (std::uint32_t x = 0; x < settings_.width; ++x) {
      if (stopped || should_stop()) {
        stopped = true;
        return;
      }
      const std::size_t i = static_cast<std::size_t>(y) * settings_.width + x;
      const std::uint32_t own_end = sums_->planned.empty() ? end : std::min(end, sums_->planned[i]);
      draw_pixel(camera, integrator, settings_, {x, y}, own_end, sums_->pixels[i],
                 sums_->layers.empty() ? nullptr : &sums_->layers[i]);
    }
    const std::lock_guard lock(progress_mutex);
    ++rows_done;
    progress(static_cast<double>(rows_done) / settings_.height);
  };
  const int threads =
      settings_.threads == 0 ? tbb::task_arena::automatic : static_cast<int>(settings_.threads);
  // TBB counts the caller as one of the arena's threads and makes no more than the machine has
  // unless it is told to.
  const tbb::global_control limit(
      tbb::global_control::max_allowed_parallelism,
      settings_.threads == 0 ? static_cast<std::size_t>(tbb::this_task_arena::max_concurrency())
                             : settings_.threads);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(std::uint32_t{0}, settings_.height, draw_row, tbb::simple_partitioner());
  });
  if (stopped) {
    throw core::Error(core::Code::kCancelled, "the picture was cancelled; nothing was written");
  }
  samples_ = end;
}

Drawing GrowingDrawing::drawing() const {
  return drawing_of(settings_, sums_->pixels, sums_->layers);
}

Drawing draw(const Camera& camera, const Integrator& integrator, const DrawSettings& settings,
             const std::function<void(double)>& progress,
             const std::function<bool()>& should_stop) {
  GrowingDrawing growing(settings);
  growing.add_samples(camera, integrator, settings.samples_per_pixel, progress, should_stop);
  return growing.drawing();
}

}  // namespace weft::render
