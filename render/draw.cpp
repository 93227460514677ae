#include "render/draw.h"

#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <vector>

#include <glm/common.hpp>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"

namespace weft::render {
namespace {

constexpr std::uint32_t kPurposeOfEyeRays = 0x65796573;  // "eyes"

// Sums over the samples of one pixel; those that met no cloth have radiance of their own.
struct PixelSums {
  glm::dvec3 radiance{0, 0, 0};
  glm::dvec3 squared{0, 0, 0};
  glm::dvec3 cloth_radiance{0, 0, 0};
  glm::dvec3 cloth_squared{0, 0, 0};
  std::uint32_t on_cloth = 0;
};

PixelSums draw_pixel(const Camera& camera, const Integrator& integrator,
                     const DrawSettings& settings, std::uint32_t x, std::uint32_t y) {
  const std::uint64_t seed = core::derive_seed(settings.seed, kPurposeOfEyeRays);
  PixelSums sums;
  for (std::uint32_t sample = 0; sample < settings.samples_per_pixel; ++sample) {
    core::Random random(seed, y * settings.width + x, sample);
    const double dx = random.uniform_double();
    const double dy = random.uniform_double();
    const EyeSample seen = integrator.trace(
        camera.ray({(x + dx) / settings.width, (y + dy) / settings.height}), random);
    const glm::dvec3 radiance(seen.radiance);
    sums.radiance += radiance;
    sums.squared += radiance * radiance;
    if (seen.on_cloth) {
      sums.cloth_radiance += radiance;
      sums.cloth_squared += radiance * radiance;
      ++sums.on_cloth;
    }
  }
  return sums;
}

void store_pixel(Drawing& drawing, const PixelSums& sums, double count, std::uint32_t x,
                 std::uint32_t y) {
  const glm::dvec3 mean = sums.radiance / count;
  // Precomputed multiple scattering may be negative in single samples; a picture is not.
  drawing.image.at(x, y) = glm::max(glm::vec3(mean), glm::vec3(0));
  if (count > 1) {
    for (int c = 0; c < 3; ++c) {
      const double variance =
          std::fmax(0.0, sums.squared[c] - sums.radiance[c] * mean[c]) / (count - 1);
      drawing.standard_error.at(x, y)[c] = static_cast<float>(std::sqrt(variance / count));
    }
  }
}

// The mean over the cloth is a ratio, sum of radiance over sum of hits; its error is that of the
// residual radiance - mean hit, whose variance is taken within each pixel.
void summarise(Drawing& drawing, const std::vector<PixelSums>& pixels, double count) {
  glm::dvec3 radiance(0);
  double hits = 0;
  for (const PixelSums& sums : pixels) {
    radiance += sums.cloth_radiance;
    hits += sums.on_cloth;
  }
  drawing.cloth_share = hits / (count * static_cast<double>(pixels.size()));
  if (!(hits > 0)) {
    return;
  }
  drawing.cloth_mean = radiance / hits;
  if (!(count > 1)) {
    return;
  }
  glm::dvec3 variance(0);
  for (const PixelSums& sums : pixels) {
    const double on_cloth = sums.on_cloth;
    const glm::dvec3& mean = drawing.cloth_mean;
    const glm::dvec3 residual = sums.cloth_radiance - mean * on_cloth;
    const glm::dvec3 squared =
        sums.cloth_squared - 2.0 * mean * sums.cloth_radiance + mean * mean * on_cloth;
    variance += (squared - residual * residual / count) * (count / (count - 1));
  }
  for (int c = 0; c < 3; ++c) {
    drawing.cloth_standard_error[c] = std::sqrt(std::fmax(0.0, variance[c])) / hits;
  }
}

}  // namespace

Drawing draw(const Camera& camera, const Integrator& integrator, const DrawSettings& settings,
             const std::function<void(double)>& progress,
             const std::function<bool()>& should_stop) {
  CHECK(settings.width > 0 && settings.height > 0 && settings.samples_per_pixel > 0);
  CHECK(settings.width <= kImageSideLimit && settings.height <= kImageSideLimit);
  Drawing drawing;
  drawing.image = Image(settings.width, settings.height);
  drawing.standard_error = Image(settings.width, settings.height);
  std::vector<PixelSums> pixels(drawing.image.pixels.size());
  std::atomic<bool> stopped = false;
  std::mutex progress_mutex;
  std::uint32_t rows_done = 0;  // under progress_mutex
  const auto draw_row = [&](std::uint32_t y) {
    for (std::uint32_t x = 0; x < settings.width; ++x) {
      if (stopped || should_stop()) {
        stopped = true;
        return;
      }
      PixelSums& sums = pixels[static_cast<std::size_t>(y) * settings.width + x];
      sums = draw_pixel(camera, integrator, settings, x, y);
      store_pixel(drawing, sums, settings.samples_per_pixel, x, y);
    }
    const std::lock_guard lock(progress_mutex);
    ++rows_done;
    progress(static_cast<double>(rows_done) / settings.height);
  };
  const int threads =
      settings.threads == 0 ? tbb::task_arena::automatic : static_cast<int>(settings.threads);
  // TBB counts the caller as one of the arena's threads and makes no more than the machine has
  // unless it is told to.
  const tbb::global_control limit(
      tbb::global_control::max_allowed_parallelism,
      settings.threads == 0 ? static_cast<std::size_t>(tbb::this_task_arena::max_concurrency())
                            : settings.threads);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(std::uint32_t{0}, settings.height, draw_row, tbb::simple_partitioner());
  });
  if (stopped) {
    throw core::Error(core::Code::kCancelled, "the picture was cancelled; nothing was written");
  }
  summarise(drawing, pixels, settings.samples_per_pixel);
  return drawing;
}

}  // namespace weft::render
