#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace weft::fabric {

// What a thread is in the cloth.
enum class Role : std::uint8_t { kWarp = 0, kWeft = 1, kCurve = 2, kExplicit = 3 };

// One yarn of the tile: an end, a pick, or a curve of a knit.
struct Thread {
  std::uint32_t yarn = 0;  // index into Tile::yarn_names
  Role role = Role::kWarp;
  std::uint32_t index = 0;  // number of the end, pick or curve
};

// One connected fibre. Its points are consecutive in Tile::points_mm and are not wrapped: a strand
// may leave the tile's box. A periodic strand's last point is its first one moved by
// (period_x size_x, period_y size_y, 0) exactly, and it goes on there; with period (0, 0) both ends
// are open. The copy of the strand in tile (i, j) is the strand itself where (i, j) is a whole
// multiple of a non-zero period, and another fibre elsewhere.
struct Strand {
  std::uint32_t first_point = 0;
  std::uint32_t point_count = 0;  // at least 2; the strand has point_count - 1 segments
  std::uint32_t material = 0;     // index into Tile::material_names
  std::uint32_t thread = 0;       // index into Tile::threads
  float radius_mm = 0;
  std::int32_t period_x = 0;
  std::int32_t period_y = 0;
};

// A straight piece of a strand: a capsule (all points within radius of the line from a to b).
struct Segment {
  glm::vec3 a_mm;
  glm::vec3 b_mm;
  float radius_mm;
};

// The fibres of one tile of cloth, endlessly repeated by size_mm along x (across, the weft's
// direction) and y (along, the warp's direction); z points out of the cloth, to the viewer.
struct Tile {
  glm::vec2 size_mm{0, 0};
  float z_min_mm = 0;  // bounds of all fibres, radii included
  float z_max_mm = 0;
  glm::uvec2 blocks{1, 1};  // equal blocks of whole ends and picks, across and along
  std::vector<std::string> material_names;
  std::vector<std::string> yarn_names;
  std::vector<Thread> threads;
  std::vector<Strand> strands;
  std::vector<glm::vec3> points_mm;

  // Segment k lies on strand segment_strand[k] between points k + segment_strand[k] and the next:
  // segments are numbered along the strands, and every strand has one point more than segments.
  // Derived from strands by index_segments.
  std::vector<std::uint32_t> segment_strand;

  [[nodiscard]] std::uint32_t segment_count() const {
    return static_cast<std::uint32_t>(segment_strand.size());
  }
  [[nodiscard]] Segment segment(std::uint32_t k) const;
  // Midpoint, wrapped into [0, size) along x and y.
  [[nodiscard]] glm::vec3 wrapped_midpoint(std::uint32_t k) const;
};

// Fills segment_strand from strands. Throws core::Error(kDataLoss) when the strands do not
// partition the points, name a missing material or thread, or a number is not finite: a tile that
// passes is safe to use.
void index_segments(Tile& tile);

// The tile as an envelope of arrays (docs/database_format.md, /exemplar, has the same arrays), and
// back. decode_tile throws core::Error(kDataLoss) on anything malformed.
[[nodiscard]] std::string encode_tile(const Tile& tile);
[[nodiscard]] Tile decode_tile(std::string_view bytes);

}  // namespace weft::fabric
