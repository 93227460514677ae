#pragma once

#include <cstdint>
#include <functional>

#include <glm/vec3.hpp>

#include "render/camera.h"
#include "render/image.h"
#include "render/integrator.h"

namespace weft::render {

struct DrawSettings {
  std::uint32_t width = 512;
  std::uint32_t height = 512;
  std::uint32_t samples_per_pixel = 64;
  std::uint64_t seed = 1;
  unsigned threads = 0;  // 0: as many as the machine has
};

struct Drawing {
  Image image;           // mean radiance of each pixel
  Image standard_error;  // of that mean; zero with one sample a pixel
  // Over all eye rays that met cloth: their mean radiance and its standard error, and the share of
  // eye rays that met it. The pixels are fixed, so that only the spread within them counts.
  glm::dvec3 cloth_mean{0, 0, 0};
  glm::dvec3 cloth_standard_error{0, 0, 0};
  double cloth_share = 0;
};

// Draws the picture. The random numbers of a sample depend on nothing but (seed, pixel, sample):
// the picture is the same for any number of threads. Calls `progress` with the share done, from any
// thread but one at a time, and `should_stop` now and then; throws core::Error(kCancelled) when it
// says so. REQUIRES: width, height and samples_per_pixel are positive.
[[nodiscard]] Drawing draw(const Camera& camera, const Integrator& integrator,
                           const DrawSettings& settings,
                           const std::function<void(double)>& progress,
                           const std::function<bool()>& should_stop);

}  // namespace weft::render
