#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::fabric {

// The fibres of a tile as nodes that may move: the last point of a periodic strand is no node of
// its own but the first one, moved by the strand's period.
struct FibreBody {
  // Straight piece from node a to node b moved by shift_mm.
  struct Piece {
    std::uint32_t a = 0;
    std::uint32_t b = 0;
    std::uint32_t strand = 0;
    double radius_mm = 0;
    glm::dvec3 shift_mm{0};
  };
  glm::dvec2 size_mm{0};
  std::vector<glm::dvec3> nodes_mm;
  std::vector<Piece> pieces;               // in the order of the tile's segments
  std::vector<glm::ivec2> strand_periods;  // [strand]
  std::vector<std::uint32_t> first_nodes;  // [strand], and the number of nodes at the end

  // REQUIRES: the strands partition the points (index_segments need not have run).
  explicit FibreBody(const Tile& tile);
  // Moves the tile's points to the nodes, rounded once; periodic strands keep their period exactly.
  void write_to(Tile& tile) const;

  [[nodiscard]] glm::dvec3 begin_mm(const Piece& piece) const { return nodes_mm[piece.a]; }
  [[nodiscard]] glm::dvec3 end_mm(const Piece& piece) const {
    return nodes_mm[piece.b] + piece.shift_mm;
  }
};

}  // namespace weft::fabric
