#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::render::gpu {

// The paper's volume over one tile (Khungurn et al. 2017, section 5.1): a voxel whose centre lies
// in fibres names, of those segments, the one whose midpoint is nearest to its centre, counted from
// 1; 0 is empty. x runs fastest.
struct NearestVolume {
  glm::ivec3 voxels{0, 0, 0};
  std::vector<std::uint32_t> segments;
};

// Between two planes of the tile. Voxels are as long as the finest fibre's radius, or as large as
// most_bytes demands.
[[nodiscard]] NearestVolume build_nearest_volume(const fabric::Tile& tile, double z_low_mm,
                                                 double z_high_mm, std::uint64_t most_bytes);

}  // namespace weft::render::gpu
