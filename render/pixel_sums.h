#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "render/draw.h"
#include "render/layers.h"

namespace weft::render {

// Sums over the samples of one pixel; those that met no cloth have radiance of their own.
struct PixelSums {
  glm::dvec3 radiance{0, 0, 0};
  glm::dvec3 squared{0, 0, 0};
  glm::dvec3 cloth_radiance{0, 0, 0};
  glm::dvec3 cloth_squared{0, 0, 0};
  std::uint32_t on_cloth = 0;
  std::uint32_t samples = 0;
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

// The drawing that the sums over the samples of [height, width] pixels make, and those of their
// layers where any is wanted. REQUIRES: each pixel has a sample.
[[nodiscard]] Drawing drawing_of(const DrawSettings& settings, const std::vector<PixelSums>& pixels,
                                 const std::vector<LayerSums>& layers);

}  // namespace weft::render
