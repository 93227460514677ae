#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "render/fabric.h"
#include "render/image.h"
#include "render/integrator.h"

namespace weft::render {

// What one fibre segment of endless flat cloth sends to a fixed eye, as a function of where light
// comes from: weights at directions of light, from which the response to any spherical Gaussian
// light follows (Khungurn et al. 2017, figures 10 and 11). Directions are of the flat fabric.
class LightResponse {
 public:
  LightResponse();

  // One of `samples()` estimates sends `weight` for light of unit irradiance from `towards`.
  void add(const glm::vec3& towards, const glm::vec3& weight);
  // Estimates, also those that sent nothing; 1 where the weights are no estimates but a sum.
  void set_samples(std::uint64_t samples) { samples_ = samples; }

  struct Map {
    Image radiance;
    Image standard_error;  // of estimates; nothing for a sum
  };
  // The radiance under the normalised light G(omega; xi, sharpness) / M: xi of pixel (x, y) has
  // polar angle (y + 1/2) pi / height and azimuth (x + 1/2) 2 pi / width.
  [[nodiscard]] Map under_gaussian(float sharpness, std::uint32_t width,
                                   std::uint32_t height) const;

 private:
  std::uint64_t samples_ = 1;
  std::vector<glm::dvec3> weights_;  // of directions in bins of polar angle and azimuth
  std::vector<glm::dvec3> squares_;
};

// The direction of pixel (x, y) of such a map.
[[nodiscard]] glm::vec3 direction_of_pixel(std::uint32_t x, std::uint32_t y, std::uint32_t width,
                                           std::uint32_t height);

struct ResponseSettings {
  Scattering scattering = Scattering::kAll;
  std::uint64_t paths = 1000000;
  std::uint64_t seed = 1;
};

// The truth: directions drawn from the BCSDF at the segment's bake point, followed through the
// cloth until they leave it. Light from below the horizon counts nothing.
[[nodiscard]] LightResponse measured_response(const Fabric& fabric, std::uint32_t segment,
                                              const glm::vec3& omega_o,
                                              const ResponseSettings& settings);

}  // namespace weft::render
