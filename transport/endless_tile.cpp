#include "transport/endless_tile.h"

#include <array>
#include <limits>
#include <string>

#include <glm/geometric.hpp>

#include "core/error.h"

namespace weft::transport {

namespace {

// A leg of a ray ends this many radii before the copies do, and the next one starts anew.
constexpr float kReachRadii = 20;
// A tile smaller than its thickness is copied into one of at most this many capsules.
constexpr std::uint64_t kMaxCapsules = std::uint64_t{1} << 25;

}  // namespace

// Chooses how many tiles make a block: one that a ray crosses in few legs.
EndlessTile::EndlessTile(const fabric::Tile& tile_in) : tile(tile_in) {
  float max_radius = 0;
  float min_radius = std::numeric_limits<float>::max();
  z_min_mm = std::numeric_limits<float>::max();
  z_max_mm = -z_min_mm;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::vec3 half = 0.5f * (s.b_mm - s.a_mm);
    overhang_mm =
        std::max({overhang_mm, std::abs(half.x) + s.radius_mm, std::abs(half.y) + s.radius_mm});
    longest_chord_mm = std::max(longest_chord_mm, 2.001f * (glm::length(half) + s.radius_mm));
    max_radius = std::max(max_radius, s.radius_mm);
    min_radius = std::min(min_radius, s.radius_mm);
    z_min_mm = std::min(z_min_mm, std::min(s.a_mm.z, s.b_mm.z) - s.radius_mm);
    z_max_mm = std::max(z_max_mm, std::max(s.a_mm.z, s.b_mm.z) + s.radius_mm);
  }
  overlap_mm = 1e-3f * min_radius;
  overhang_mm *= 1.0001f;
  const float reach = overhang_mm + std::max(z_max_mm - z_min_mm, kReachRadii * max_radius);
  std::array<double, 2> needed{};
  for (int axis = 0; axis < 2; ++axis) {
    needed[static_cast<std::size_t>(axis)] =
        std::max(1.0, std::ceil(static_cast<double>(reach) / tile.size_mm[axis]));
  }
  if (!(needed[0] * needed[1] * tile.segment_count() <= static_cast<double>(kMaxCapsules))) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the tile is too small for its fibres: their segments reach over " +
                          std::to_string(needed[0]) + " x " + std::to_string(needed[1]) +
                          " tiles; use shorter segments or more repeats");
  }
  copies = {static_cast<int>(needed[0]), static_cast<int>(needed[1])};
  block_size_mm = {needed[0] * tile.size_mm.x, needed[1] * tile.size_mm.y};
}

glm::ivec2 EndlessTile::tile_of_midpoint(std::uint32_t segment) const {
  const fabric::Segment s = tile.segment(segment);
  const glm::vec3 middle = 0.5f * (s.a_mm + s.b_mm);
  const glm::vec3 wrapped = tile.wrapped_midpoint(segment);
  return {static_cast<int>(std::lround((middle.x - wrapped.x) / tile.size_mm.x)),
          static_cast<int>(std::lround((middle.y - wrapped.y) / tile.size_mm.y))};
}

}  // namespace weft::transport
