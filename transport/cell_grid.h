#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "transport/checkpoint.h"
#include "transport/scene.h"

namespace weft::transport {

// Mean free path between fibres, in millimetres: the sum of all free flights over the number of
// fibre hits, the maximum-likelihood estimate for exponential lengths of which some are censored
// (the mean over completed flights alone is biased low). `rays` flights start at the midpoints of
// segments drawn at random, in isotropic directions, their own fibre ignored; those that escape are
// cut at the tile's slab bounds. Geometry only: colours do not change the grid. When nothing is hit
// at all, the length flown, a lower bound. REQUIRES: rays > 0.
[[nodiscard]] double mean_free_path(const Scene& scene, std::uint32_t rays, std::uint64_t seed,
                                    const Checkpoint& checkpoint = {});

// The cells over which transfer matrices are averaged (Khungurn et al. 2017, section 4.2): equal
// boxes, a whole number of them per block of the tile and axis, so that none straddles a block.
struct CellGrid {
  glm::uvec3 cells_per_axis{1, 1, 1};          // over the whole tile and its thickness
  std::vector<std::uint32_t> cell_of_segment;  // [segments], by the segment's wrapped midpoint
  std::vector<glm::uvec3> cell_coordinates;    // [cells]: those that hold a segment, z slowest
};

// Cells about `cell_length_mm` long: n = max(1, round(extent / length)) per block and axis.
// REQUIRES: cell_length_mm > 0.
[[nodiscard]] CellGrid make_cell_grid(const fabric::Tile& tile, double cell_length_mm);

}  // namespace weft::transport
