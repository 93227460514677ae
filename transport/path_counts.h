#pragma once

#include <array>
#include <cstdint>

#include <glm/vec3.hpp>

#include "shading/scattering_orders.h"

namespace weft::transport {

// By which lobes of which materials a path was scattered: what its throughput owes to colours.
// A reflection's Fresnel factor is C_R (1 - s) + s with Schlick's weight s: it counts as coloured
// by the share that the first term has in it, by channel. A transmission's factor is
// (1 - C_R) C_TT (1 - s). Materials beyond kMostCountedMaterials are not counted.
struct PathCounts {
  struct Material {
    glm::vec3 coloured{0, 0, 0};  // sum over the reflections
    std::uint32_t reflections = 0;
    std::uint32_t transmissions = 0;
  };
  std::array<Material, shading::kMostCountedMaterials> of{};
};

}  // namespace weft::transport
