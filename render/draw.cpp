#include "render/draw.h"

#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <vector>

#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/check.h"
#include "core/error.h"
#include "core/random.h"

namespace weft::render {
namespace {

// Sums over the samples of one pixel; those that met no cloth have radiance of their own.
struct PixelSums {
  glm::dvec3 radiance{0, 0, 0};
  glm::dvec3 squared{0, 0, 0};
  glm::dvec3 cloth_radiance{0, 0, 0};
  glm::dvec3 cloth_squared{0, 0, 0};
  std::uint32_t on_cloth = 0;
};

// Sums over the samples of one pixel for its layers, and what its first sample saw.
struct LayerSums {
  glm::dvec3 single{0, 0, 0};
  glm::dvec3 multiple{0, 0, 0};
  double shadow = 0;
  std::uint32_t segment = kNoSegment;
  std::uint32_t cloth = kNoSegment;
  glm::vec3 tangent{0, 0, 0};
  glm::vec3 normal{0, 0, 0};
};

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

// Which samples of a pixel are drawn.
struct SampleRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

// `layers` may be null.
void draw_pixel(const Camera& camera, const Integrator& integrator, const DrawSettings& settings,
                glm::uvec2 pixel, SampleRange range, PixelSums& sums, LayerSums* layers) {
  const std::uint64_t seed = core::derive_seed(settings.seed, kPurposeOfEyeRays);
  for (std::uint32_t sample = range.first; sample < range.first + range.count; ++sample) {
    core::Random random(seed, pixel.y * settings.width + pixel.x, sample);
    const double dx = random.uniform_double();
    const double dy = random.uniform_double();
    const EyeSample seen = integrator.trace(
        camera.ray({(pixel.x + dx) / settings.width, (pixel.y + dy) / settings.height}), random);
    const glm::dvec3 radiance(seen.radiance);
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

void store_pixel(Drawing& drawing, const PixelSums& sums, double count, std::size_t i) {
  const glm::dvec3 mean = sums.radiance / count;
  // Precomputed multiple scattering may be negative in single samples; a picture is not.
  drawing.image.pixels[i] = glm::max(glm::vec3(mean), glm::vec3(0));
  if (count > 1) {
    for (int c = 0; c < 3; ++c) {
      const double variance =
          std::fmax(0.0, sums.squared[c] - sums.radiance[c] * mean[c]) / (count - 1);
      drawing.standard_error.pixels[i][c] = static_cast<float>(std::sqrt(variance / count));
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

template <class T, class Value>
std::vector<T> plane(bool wanted, std::size_t count, const Value& value) {
  std::vector<T> values;
  if (wanted) {
    values.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      values.push_back(value(i));
    }
  }
  return values;
}

Layers layers_of(LayerSet wanted, const std::vector<LayerSums>& sums,
                 const std::vector<PixelSums>& pixels, double count) {
  const std::size_t size = sums.size();
  const auto mean = [count](const glm::dvec3& sum) {
    return glm::max(glm::vec3(sum / count), glm::vec3(0));
  };
  const bool segment = wanted.has(Layer::kSegment);
  Layers layers;
  layers.single = plane<glm::vec3>(wanted.has(Layer::kSingle), size,
                                   [&](std::size_t i) { return mean(sums[i].single); });
  layers.multiple = plane<glm::vec3>(wanted.has(Layer::kMultiple), size,
                                     [&](std::size_t i) { return mean(sums[i].multiple); });
  layers.shadow = plane<float>(wanted.has(Layer::kShadow), size, [&](std::size_t i) {
    return pixels[i].on_cloth > 0 ? static_cast<float>(sums[i].shadow / pixels[i].on_cloth) : 0.0f;
  });
  layers.segment =
      plane<std::uint32_t>(segment, size, [&](std::size_t i) { return sums[i].segment; });
  layers.cloth = plane<std::uint32_t>(segment, size, [&](std::size_t i) { return sums[i].cloth; });
  layers.tangent = plane<glm::vec3>(wanted.has(Layer::kTangent), size,
                                    [&](std::size_t i) { return sums[i].tangent; });
  layers.normal = plane<glm::vec3>(wanted.has(Layer::kNormal), size,
                                   [&](std::size_t i) { return sums[i].normal; });
  return layers;
}

}  // namespace

struct GrowingDrawing::Sums {
  std::vector<PixelSums> pixels;
  std::vector<LayerSums> layers;  // empty when no layer is wanted
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

void GrowingDrawing::add_samples(const Camera& camera, const Integrator& integrator,
                                 std::uint32_t count, const std::function<void(double)>& progress,
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
      draw_pixel(camera, integrator, settings_, {x, y}, {samples_, count}, sums_->pixels[i],
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
  samples_ += count;
}

Drawing GrowingDrawing::drawing() const {
  CHECK(samples_ > 0);
  Drawing drawing;
  drawing.image = Image(settings_.width, settings_.height);
  drawing.standard_error = Image(settings_.width, settings_.height);
  for (std::size_t i = 0; i < sums_->pixels.size(); ++i) {
    store_pixel(drawing, sums_->pixels[i], samples_, i);
  }
  drawing.layers = layers_of(settings_.layers, sums_->layers, sums_->pixels, samples_);
  summarise(drawing, sums_->pixels, samples_);
  return drawing;
}

Drawing draw(const Camera& camera, const Integrator& integrator, const DrawSettings& settings,
             const std::function<void(double)>& progress,
             const std::function<bool()>& should_stop) {
  GrowingDrawing growing(settings);
  growing.add_samples(camera, integrator, settings.samples_per_pixel, progress, should_stop);
  return growing.drawing();
}

}  // namespace weft::render
