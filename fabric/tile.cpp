#include "fabric/tile.h"

#include <cmath>

#include "core/error.h"

namespace weft::fabric {

Segment Tile::segment(std::uint32_t k) const {
  const std::uint32_t strand = segment_strand[k];
  const std::uint32_t point = k + strand;
  return {points_mm[point], points_mm[point + 1], strands[strand].radius_mm};
}

glm::vec3 Tile::wrapped_midpoint(std::uint32_t k) const {
  const Segment s = segment(k);
  glm::vec3 middle = 0.5f * (s.a_mm + s.b_mm);
  for (int axis = 0; axis < 2; ++axis) {
    middle[axis] -= std::floor(middle[axis] / size_mm[axis]) * size_mm[axis];
    if (middle[axis] >= size_mm[axis]) {  // a tiny negative rounds up to the size itself
      middle[axis] = 0;
    }
  }
  return middle;
}

void index_segments(Tile& tile) {
  const auto refuse = [](const std::string& what) {
    throw core::Error(core::Code::kDataLoss, "the tile is damaged: " + what);
  };
  if (!(tile.size_mm.x > 0 && tile.size_mm.y > 0) || !std::isfinite(tile.size_mm.x) ||
      !std::isfinite(tile.size_mm.y) || !(tile.z_min_mm < tile.z_max_mm) ||
      !std::isfinite(tile.z_min_mm) || !std::isfinite(tile.z_max_mm)) {
    refuse("its size is not positive and finite");
  }
  tile.segment_strand.clear();
  std::uint64_t next_point = 0;
  for (std::size_t s = 0; s < tile.strands.size(); ++s) {
    const Strand& strand = tile.strands[s];
    if (strand.first_point != next_point || strand.point_count < 2) {
      refuse("strand " + std::to_string(s) + " does not follow the one before it");
    }
    if (strand.material >= tile.material_names.size() || strand.thread >= tile.threads.size()) {
      refuse("strand " + std::to_string(s) + " names a missing material or thread");
    }
    if (!(strand.radius_mm > 0) || !std::isfinite(strand.radius_mm)) {
      refuse("strand " + std::to_string(s) + " has no radius");
    }
    next_point += strand.point_count;
    if (next_point > tile.points_mm.size()) {
      refuse("strand " + std::to_string(s) + " has points that are missing");
    }
    tile.segment_strand.insert(tile.segment_strand.end(), strand.point_count - 1,
                               static_cast<std::uint32_t>(s));
  }
  if (next_point != tile.points_mm.size()) {
    refuse("points belong to no strand");
  }
  for (const glm::vec3& point : tile.points_mm) {
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.z)) {
      refuse("a point is not finite");
    }
  }
}

}  // namespace weft::fabric
