#include "transport/cell_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/check.h"
#include "core/random.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

// Finer grids than the coordinates of a cell can tell apart help nobody.
constexpr double kMaxCellsPerAxis = 65535;

std::uint32_t cells_over(double extent, double length) {
  return static_cast<std::uint32_t>(std::clamp(std::round(extent / length), 1.0, kMaxCellsPerAxis));
}

std::uint32_t cell_along(double at, double extent, std::uint32_t cells) {
  const double index = std::floor(at / extent * static_cast<double>(cells));
  return static_cast<std::uint32_t>(std::clamp(index, 0.0, static_cast<double>(cells - 1)));
}

// Distance to the slab's bounds; rays in its plane go a thousand thicknesses at most.
double distance_to_bounds(const fabric::Tile& tile, double z, double direction_z) {
  const double bound = direction_z > 0 ? tile.z_max_mm : tile.z_min_mm;
  const double thickness = static_cast<double>(tile.z_max_mm) - static_cast<double>(tile.z_min_mm);
  const double longest = 1000 * thickness;
  return direction_z == 0 ? longest : std::min(longest, std::max(0.0, (bound - z) / direction_z));
}

}  // namespace

double mean_free_path(const Scene& scene, std::uint32_t rays, std::uint64_t seed,
                      const Checkpoint& checkpoint) {
  const fabric::Tile& tile = scene.tile();
  double flown_mm = 0;
  std::uint32_t hits = 0;
  for (std::uint32_t i = 0; i < rays; ++i) {
    if (i % 8192 == 0) {
      pass(checkpoint);
    }
    core::Random random(seed, i);
    const std::uint32_t segment = random.below(tile.segment_count());
    const float u_z = random.uniform();
    const glm::vec3 direction = uniform_direction(u_z, random.uniform());
    const glm::vec3 origin = tile.wrapped_midpoint(segment);
    const double limit_mm =
        distance_to_bounds(tile, static_cast<double>(origin.z), static_cast<double>(direction.z));
    const auto hit =
        scene.closest(origin, direction, static_cast<float>(limit_mm), scene.own_copy(segment));
    flown_mm += hit ? static_cast<double>(hit->t_mm) : limit_mm;
    hits += hit ? 1 : 0;
  }
  return flown_mm / std::max(1.0, static_cast<double>(hits));
}

CellGrid make_cell_grid(const fabric::Tile& tile, double cell_length_mm) {
  CHECK_GT(cell_length_mm, 0.0);
  const glm::dvec3 extent{tile.size_mm.x, tile.size_mm.y,
                          static_cast<double>(tile.z_max_mm) - static_cast<double>(tile.z_min_mm)};
  CellGrid grid;
  grid.cells_per_axis = {tile.blocks.x * cells_over(extent.x / tile.blocks.x, cell_length_mm),
                         tile.blocks.y * cells_over(extent.y / tile.blocks.y, cell_length_mm),
                         cells_over(extent.z, cell_length_mm)};
  const glm::uvec3 cells = grid.cells_per_axis;

  std::vector<std::uint64_t> place(tile.segment_count());
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const glm::dvec3 middle(tile.wrapped_midpoint(k));
    const std::uint64_t x = cell_along(middle.x, extent.x, cells.x);
    const std::uint64_t y = cell_along(middle.y, extent.y, cells.y);
    const std::uint64_t z =
        cell_along(middle.z - static_cast<double>(tile.z_min_mm), extent.z, cells.z);
    place[k] = (z * cells.y + y) * cells.x + x;
  }
  std::vector<std::uint64_t> occupied = place;
  std::sort(occupied.begin(), occupied.end());
  occupied.erase(std::unique(occupied.begin(), occupied.end()), occupied.end());
  for (const std::uint64_t cell : occupied) {
    grid.cell_coordinates.emplace_back(static_cast<std::uint32_t>(cell % cells.x),
                                       static_cast<std::uint32_t>(cell / cells.x % cells.y),
                                       static_cast<std::uint32_t>(cell / cells.x / cells.y));
  }
  grid.cell_of_segment.reserve(place.size());
  for (const std::uint64_t cell : place) {
    const auto at = std::lower_bound(occupied.begin(), occupied.end(), cell);
    grid.cell_of_segment.push_back(static_cast<std::uint32_t>(at - occupied.begin()));
  }
  return grid;
}

}  // namespace weft::transport
