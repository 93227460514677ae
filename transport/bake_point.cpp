#include "transport/bake_point.h"

#include <algorithm>
#include <numbers>

#include <glm/geometric.hpp>

namespace weft::transport {
namespace {

constexpr float kHeightInRadii = std::numbers::pi_v<float> / 4;
constexpr float kUpright = 1e-6f;  // squared sine to the vertical below which no side is upper

}  // namespace

BakePoint bake_point(const Scene& scene, std::uint32_t segment) {
  const fabric::Tile& tile = scene.tile();
  const fabric::Segment s = tile.segment(segment);
  const glm::vec3 tangent = glm::normalize(s.b_mm - s.a_mm);
  glm::vec3 point = tile.wrapped_midpoint(segment);
  const glm::vec3 up = glm::vec3(0, 0, 1) - tangent.z * tangent;
  if (glm::dot(up, up) > kUpright) {
    point += kHeightInRadii * s.radius_mm * glm::normalize(up);
  }
  const glm::ivec2 tile_of = scene.tile_of(point);
  for (int axis = 0; axis < 2; ++axis) {
    const float size = tile.size_mm[axis];
    point[axis] -= static_cast<float>(tile_of[axis]) * size;
    if (point[axis] < 0 || point[axis] >= size) {  // rounding, at the very border
      point[axis] = 0;
    }
  }
  return {point, scene.seen_from(scene.own_copy(segment), tile_of)};
}

}  // namespace weft::transport
