#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/random.h"
#include "tests/transport_tiles.h"
#include "transport/sphere.h"

// Visibility images for the tests of transport/.
namespace weft::test {

inline glm::dvec3 pixel_direction(std::uint32_t pixel, std::uint32_t resolution) {
  const double theta = transport::row_theta(pixel / resolution, resolution);
  const double phi = transport::column_phi(pixel % resolution, resolution);
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

// Random blobs: what is visible is the union of caps.
inline std::vector<std::uint8_t> random_image(std::uint32_t resolution, int caps,
                                              std::uint64_t seed) {
  std::vector<std::uint8_t> bits(resolution * resolution / 8);
  for (std::uint32_t p = 0; p < resolution * resolution; ++p) {
    for (int i = 0; i < caps; ++i) {
      core::Random random(seed, static_cast<std::uint32_t>(i));
      const glm::dvec3 centre(random_direction(random));
      const double radius = 0.05 + 0.4 * random.uniform_double();
      if (glm::dot(centre, pixel_direction(p, resolution)) > std::cos(radius)) {
        bits[p / 8] = static_cast<std::uint8_t>(bits[p / 8] | 1U << (p % 8));
      }
    }
  }
  return bits;
}

}  // namespace weft::test
