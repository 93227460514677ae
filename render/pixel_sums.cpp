#include "render/pixel_sums.h"

#include <cmath>
#include <cstddef>

#include <glm/common.hpp>

#include "core/check.h"

namespace weft::render {
namespace {

void store_pixel(Drawing& drawing, const PixelSums& sums, std::size_t i) {
  const double count = sums.samples;
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

// The mean over the cloth is a ratio, radiance over hits, each a sum over the pixels' means; its
// error is that of the residual radiance - mean hit, whose variance is taken within each pixel.
void summarise(Drawing& drawing, const std::vector<PixelSums>& pixels) {
  glm::dvec3 radiance(0);
  double hits = 0;
  double samples = 0;
  bool has_spread = true;
  for (const PixelSums& sums : pixels) {
    const double count = sums.samples;
    radiance += sums.cloth_radiance / count;
    hits += sums.on_cloth / count;
    samples += count;
    has_spread = has_spread && sums.samples > 1;
  }
  const auto size = static_cast<double>(pixels.size());
  drawing.mean_samples = samples / size;
  drawing.cloth_share = hits / size;
  if (!(hits > 0)) {
    return;
  }
  drawing.cloth_mean = radiance / hits;
  if (!has_spread) {
    return;
  }
  glm::dvec3 variance(0);
  for (const PixelSums& sums : pixels) {
    const double count = sums.samples;
    const double on_cloth = sums.on_cloth;
    const glm::dvec3& mean = drawing.cloth_mean;
    const glm::dvec3 residual = sums.cloth_radiance - mean * on_cloth;
    const glm::dvec3 squared =
        sums.cloth_squared - 2.0 * mean * sums.cloth_radiance + mean * mean * on_cloth;
    variance += (squared - residual * residual / count) / (count * (count - 1));
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
                 const std::vector<PixelSums>& pixels) {
  const std::size_t size = sums.size();
  const auto mean = [&](const glm::dvec3& sum, std::size_t i) {
    return glm::max(glm::vec3(sum / static_cast<double>(pixels[i].samples)), glm::vec3(0));
  };
  const bool segment = wanted.has(Layer::kSegment);
  Layers layers;
  layers.single = plane<glm::vec3>(wanted.has(Layer::kSingle), size,
                                   [&](std::size_t i) { return mean(sums[i].single, i); });
  layers.multiple = plane<glm::vec3>(wanted.has(Layer::kMultiple), size,
                                     [&](std::size_t i) { return mean(sums[i].multiple, i); });
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

Drawing drawing_of(const DrawSettings& settings, const std::vector<PixelSums>& pixels,
                   const std::vector<LayerSums>& layers) {
  Drawing drawing;
  drawing.image = Image(settings.width, settings.height);
  drawing.standard_error = Image(settings.width, settings.height);
  CHECK_EQ(pixels.size(), drawing.image.pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    CHECK(pixels[i].samples > 0);
    store_pixel(drawing, pixels[i], i);
  }
  drawing.layers = layers_of(settings.layers, layers, pixels);
  summarise(drawing, pixels);
  return drawing;
}

}  // namespace weft::render
