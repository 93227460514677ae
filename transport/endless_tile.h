#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

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
  // visit(origin in the central block, direction, length, tiles from the ray's own tile to the
  // central block, distance so far) for each until it returns true, the ray leaves the cloth or
  // kMaxLegs are done.
  template <class Visit>
  void walk(glm::vec3 origin, glm::vec3 direction, float t_max, const Visit& visit) const;
};

// A direction for Embree: its round curves miss their start cap when a ray runs along them within
// 2e-4 (measured with 3.13.5). Rays along a coordinate axis, the only ones that meet this in
// practice, are turned in the plane of the cloth.
[[nodiscard]] glm::vec3 off_axis(glm::vec3 direction);

template <class Visit>
void EndlessTile::walk(glm::vec3 origin, glm::vec3 direction, float t_max,
                       const Visit& visit) const {
  const Span slab = inside_slab(origin.z, direction.z);
  const double t_start = std::max(0.0, slab.enter);
  const glm::dvec3 start = glm::dvec3(origin) + t_start * glm::dvec3(direction);
  const glm::vec3 along = off_axis(direction);
  const double t_end = std::min(static_cast<double>(t_max),
                                t_start + inside_slab(start.z, static_cast<double>(along.z)).leave);
  const glm::ivec2 own = tile_of(origin);
  double t = t_start;
  for (int leg = 0; leg < kMaxLegs && t < t_end; ++leg) {
    double length = t_end - t;
    const glm::dvec3 at = start + (t - t_start) * glm::dvec3(along);
    glm::vec3 local(at);
    glm::ivec2 shift{0, 0};
    for (int axis = 0; axis < 2; ++axis) {
      const double block_index = std::floor(at[axis] / block_size_mm[axis]);
      local[axis] = static_cast<float>(at[axis] - block_index * block_size_mm[axis]);
      shift[axis] = static_cast<int>(block_index) * copies[axis] - own[axis];
      if (along[axis] != 0) {
        const double border = along[axis] > 0
                                  ? 2 * block_size_mm[axis] - static_cast<double>(overhang_mm)
                                  : static_cast<double>(overhang_mm) - block_size_mm[axis];
        length = std::min(
            length, (border - static_cast<double>(local[axis])) / static_cast<double>(along[axis]));
      }
    }
    if (visit(local, along, static_cast<float>(length), shift, t)) {
      return;
    }
    t += length < t_end - t ? length - static_cast<double>(overlap_mm) : length;
  }
}

}  // namespace weft::transport
