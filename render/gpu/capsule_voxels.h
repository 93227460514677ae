#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "render/kernels/grid_records.h"

namespace weft::render::gpu {

// A box of voxels over one tile.
struct VoxelFrame {
  glm::ivec3 voxels{1, 1, 1};
  glm::dvec3 low_mm{0, 0, 0};
  glm::dvec3 voxel_mm{1, 1, 1};
};

// A capsule of one tile of endless cloth.
struct TileCapsule {
  glm::dvec3 a_mm{0, 0, 0};
  glm::dvec3 b_mm{0, 0, 0};
  double radius_mm = 0;
  std::uint32_t segment = 0;
};

// All copies of the tile's segments that reach into it, grown by `margin_mm`.
[[nodiscard]] std::vector<TileCapsule> capsules_in_tile(const fabric::Tile& tile, double margin_mm);

// Distance of a point from a capsule's axis.
[[nodiscard]] inline double distance_from_axis(const TileCapsule& capsule,
                                               const glm::dvec3& point_mm) {
  const glm::dvec3 axis = capsule.b_mm - capsule.a_mm;
  const double squared = glm::dot(axis, axis);
  const double along = squared > 0 ? glm::dot(point_mm - capsule.a_mm, axis) / squared : 0.0;
  return glm::distance(point_mm, capsule.a_mm + std::clamp(along, 0.0, 1.0) * axis);
}

// Calls visit(voxel, its centre) for every voxel of the frame that the capsule, grown to `reach_mm`
// about its axis, may reach into: layer by layer across its longest direction, so that a long
// capsule does not visit the whole box around it.
template <class Visit>
void visit_voxels(const VoxelFrame& frame, const TileCapsule& capsule, double reach_mm,
                  const Visit& visit) {
  const glm::dvec3 a = (capsule.a_mm - frame.low_mm) / frame.voxel_mm;
  const glm::dvec3 b = (capsule.b_mm - frame.low_mm) / frame.voxel_mm;
  const glm::dvec3 reach = glm::dvec3(reach_mm) / frame.voxel_mm;
  const glm::dvec3 way = b - a;
  const glm::dvec3 size = glm::abs(way);
  const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  const auto first_of = [&](double low, int along) {
    return static_cast<int>(std::max(0.0, std::floor(low - reach[along])));
  };
  const auto last_of = [&](double high, int along) {
    return static_cast<int>(std::min(frame.voxels[along] - 1.0, std::floor(high + reach[along])));
  };
  const int last_layer = last_of(std::max(a[axis], b[axis]), axis);
  for (int layer = first_of(std::min(a[axis], b[axis]), axis); layer <= last_layer; ++layer) {
    // The part of the axis that can reach into the layer, as shares of its length.
    double from = 0;
    double to = 1;
    if (size[axis] > 0) {
      const double p = (layer - reach[axis] - a[axis]) / way[axis];
      const double q = (layer + 1 + reach[axis] - a[axis]) / way[axis];
      from = std::clamp(std::min(p, q), 0.0, 1.0);
      to = std::clamp(std::max(p, q), 0.0, 1.0);
    }
    const glm::dvec3 low = glm::min(a + from * way, a + to * way);
    const glm::dvec3 high = glm::max(a + from * way, a + to * way);
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    const int last_u = last_of(high[u], u);
    const int last_v = last_of(high[v], v);
    for (int i = first_of(low[u], u); i <= last_u; ++i) {
      for (int j = first_of(low[v], v); j <= last_v; ++j) {
        glm::ivec3 voxel(0);
        voxel[axis] = layer;
        voxel[u] = i;
        voxel[v] = j;
        visit(voxel, frame.low_mm + (glm::dvec3(voxel) + 0.5) * frame.voxel_mm);
      }
    }
  }
}

}  // namespace weft::render::gpu
