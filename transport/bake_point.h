#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "transport/scene.h"

namespace weft::transport {

// Where a segment's visibility and transfer are baked: above the middle of its axis, in the plane
// across the fibre, by pi/4 of its radius, which is the mean height above the axis of what the eye
// sees of a fibre from there. The eye meets fibres on their surface; seen from the axis itself
// (Khungurn et al. 2017, section 4) the sky is smaller, which costs single scattering 6 to 11 %.
struct BakePoint {
  glm::vec3 position_mm;  // in tile (0, 0)
  StrandCopy own;         // the segment's strand, relative to tile (0, 0)
};
[[nodiscard]] BakePoint bake_point(const Scene& scene, std::uint32_t segment);

}  // namespace weft::transport
