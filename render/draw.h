#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include <glm/vec3.hpp>

#include "render/camera.h"
#include "render/image.h"
#include "render/integrator.h"
#include "render/layers.h"

namespace weft::render {

// core::derive_seed of DrawSettings::seed, for the samples of pixels.
inline constexpr std::uint32_t kPurposeOfEyeRays = 0x65796573;  // "eyes"

struct DrawSettings {
  std::uint32_t width = 512;
  std::uint32_t height = 512;
  std::uint32_t samples_per_pixel = 64;
  // Above 0: pixels get fewer samples where fewer are enough (render/adaptive.h).
  double target_error = 0;
  std::uint64_t seed = 1;
  unsigned threads = 0;  // 0: as many as the machine has
  LayerSet layers;       // wanted besides the colour
};

struct Drawing {
  Image image;           // mean radiance of each pixel
  Image standard_error;  // of that mean; zero with one sample a pixel
  Layers layers;         // those that were wanted
  // Over all eye rays that met cloth: their mean radiance and its standard error, and the share of
  // eye rays that met it. The pixels are fixed, so that only the spread within them counts.
  glm::dvec3 cloth_mean{0, 0, 0};
  glm::dvec3 cloth_standard_error{0, 0, 0};
  double cloth_share = 0;
  double mean_samples = 0;  // of a pixel
};

// Draws the picture. The random numbers of a sample depend on nothing but (seed, pixel, sample):
// the picture is the same for any number of threads. Calls `progress` with the share done, from any
// thread but one at a time, and `should_stop` now and then; throws core::Error(kCancelled) when it
// says so. REQUIRES: width, height and samples_per_pixel are positive.
[[nodiscard]] Drawing draw(const Camera& camera, const Integrator& integrator,
                           const DrawSettings& settings,
                           const std::function<void(double)>& progress,
                           const std::function<bool()>& should_stop);

// A drawing that grows: the sums over the samples of each pixel so far. draw() is all samples in
// one pass; the same number in several passes gives the same picture, bit by bit.
class GrowingDrawing {
 public:
  // REQUIRES: as draw().
  explicit GrowingDrawing(const DrawSettings& settings);
  ~GrowingDrawing();
  GrowingDrawing(const GrowingDrawing&) = delete;
  GrowingDrawing& operator=(const GrowingDrawing&) = delete;
  GrowingDrawing(GrowingDrawing&&) = delete;
  GrowingDrawing& operator=(GrowingDrawing&&) = delete;

  // Adds `count` samples to every pixel, or those of them that it needs; `progress` and
  // `should_stop` as for draw(). After an exception the sums are of no use: take drawing() before.
  void add_samples(const Camera& camera, const Integrator& integrator, std::uint32_t count,
                   const std::function<void(double)>& progress,
                   const std::function<bool()>& should_stop);

  [[nodiscard]] std::uint32_t samples() const { return samples_; }
  // REQUIRES: samples() > 0.
  [[nodiscard]] Drawing drawing() const;

  // Memory that one takes, with the Drawing made of it.
  [[nodiscard]] static std::uint64_t size_bytes(const DrawSettings& settings);

 private:
  struct Sums;
  // Up to sample `end` of every pixel that needs so many.
  void add_range(const Camera& camera, const Integrator& integrator, std::uint32_t end,
                 const std::function<void(double)>& progress,
                 const std::function<bool()>& should_stop);
  void plan_if_due();

  DrawSettings settings_;
  std::unique_ptr<Sums> sums_;
  std::uint32_t samples_ = 0;
};

}  // namespace weft::render
