#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::transport {

// How a tile is repeated for tracing. `copies` tiles make a block: one that a ray crosses in few
// legs and that no capsule overhangs by more than the block's own size. 3 x 3 blocks surround every
// ray; where it nears their border it goes on, moved by whole blocks, in the central one.
struct EndlessTile {
  // Throws core::Error(kInvalidArgument) when the tile is so much smaller than its segments that
  // its copies would fill the memory.
  explicit EndlessTile(const fabric::Tile& tile_in);

  // Distances along a ray between which something holds.
  struct Span {
    double enter;
    double leave;
  };

  const fabric::Tile& tile;
  glm::ivec2 copies{1, 1};
  glm::dvec2 block_size_mm{0, 0};
  float longest_chord_mm = 0;  // no ray runs longer within one capsule
  float overhang_mm = 0;       // no capsule reaches further out of its midpoint's tile
  float overlap_mm = 0;        // legs of one ray overlap by this
  float z_min_mm = 0;
  float z_max_mm = 0;

  static constexpr int kMaxLegs = 10000;

  [[nodiscard]] glm::ivec2 tile_of(glm::vec3 point) const;
  // The tile that holds the segment's midpoint where the strand has it.
  [[nodiscard]] glm::ivec2 tile_of_midpoint(std::uint32_t segment) const;
  // Where a line lies between the bounds of all fibres; empty when it never does.
  [[nodiscard]] Span inside_slab(double z, double direction_z) const;

  // Cuts a ray into legs that stay where the nine blocks are complete, and calls
  // visit(origin in the central block, length, tiles from the ray's own tile to the
  // central block, distance so far) for each until it returns true, the ray leaves the cloth or
  // kMaxLegs are done.
  template <class Visit>
  void walk(glm::vec3 origin, glm::vec3 direction, float t_max, const Visit& visit) const;
};

inline EndlessTile::Span EndlessTile::inside_slab(double z, double direction_z) const {
  const double low = static_cast<double>(z_min_mm - overlap_mm);
  const double high = static_cast<double>(z_max_mm + overlap_mm);
  constexpr double kForever = std::numeric_limits<double>::infinity();
  if (direction_z == 0) {
    return z < low || z > high ? Span{0, -kForever} : Span{-kForever, kForever};
  }
  const double to_low = (low - z) / direction_z;
  const double to_high = (high - z) / direction_z;
  return {std::min(to_low, to_high), std::max(to_low, to_high)};
}

inline glm::ivec2 EndlessTile::tile_of(glm::vec3 point) const {
  glm::ivec2 found{0, 0};
  for (int axis = 0; axis < 2; ++axis) {
    // Most points are in the tile at home, and know it without a division.
    if (!(point[axis] >= 0 && point[axis] < tile.size_mm[axis])) {
      found[axis] = static_cast<int>(
          std::floor(static_cast<double>(point[axis]) / static_cast<double>(tile.size_mm[axis])));
    }
  }
  return found;
}

template <class Visit>
void EndlessTile::walk(glm::vec3 origin, glm::vec3 direction, float t_max,
                       const Visit& visit) const {
  const Span slab = inside_slab(origin.z, direction.z);
  const double t_start = std::max(0.0, slab.enter);
  const glm::dvec3 along(direction);
  const glm::dvec3 start = glm::dvec3(origin) + t_start * along;
  const double t_end = std::min(static_cast<double>(t_max), slab.leave);
  const glm::ivec2 own = tile_of(origin);
  double t = t_start;
  for (int leg = 0; leg < kMaxLegs && t < t_end; ++leg) {
    double length = t_end - t;
    const glm::dvec3 at = start + (t - t_start) * along;
    glm::vec3 local(at);
    glm::ivec2 shift = -own;
    for (int axis = 0; axis < 2; ++axis) {
      if (!(at[axis] >= 0 && at[axis] < block_size_mm[axis])) {
        const double block_index = std::floor(at[axis] / block_size_mm[axis]);
        local[axis] = static_cast<float>(at[axis] - block_index * block_size_mm[axis]);
        shift[axis] += static_cast<int>(block_index) * copies[axis];
      }
      if (direction[axis] != 0) {
        const double border = direction[axis] > 0
                                  ? 2 * block_size_mm[axis] - static_cast<double>(overhang_mm)
                                  : static_cast<double>(overhang_mm) - block_size_mm[axis];
        length = std::min(length, (border - static_cast<double>(local[axis])) / along[axis]);
      }
    }
    if (visit(local, static_cast<float>(length), shift, t)) {
      return;
    }
    t += length < t_end - t ? length - static_cast<double>(overlap_mm) : length;
  }
}

}  // namespace weft::transport
