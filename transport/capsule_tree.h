#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "transport/ball_regions.h"
#include "transport/scene.h"

namespace weft::transport {

// A piece of a segment, at most some radii long, so that a ball fits it well.
struct Piece {
  glm::vec3 start_mm;
  glm::vec3 axis;  // unit
  float length_mm;
  float radius_mm;
  StrandCopy copy;  // when the piece's block is at the origin
};

// Balls round what is below. A leaf's are those of pieces first ... first + count - 1, an inner
// node's those of nodes first ... first + count - 1.
struct TreeNode {
  Balls balls_mm;
  std::uint32_t first;
  std::uint32_t count;
  bool is_leaf;
};

// The capsules of one block (as many tiles as make it at least as long as it is thick, or 1) in a
// hierarchy of balls, sixteen to a node, the root at nodes[0]. The same for the same tile.
struct CapsuleTree {
  explicit CapsuleTree(const Scene& scene);

  glm::ivec2 tiles{1, 1};  // in the block
  glm::dvec2 size_mm{0, 0};
  float overhang_mm = 0;  // no piece reaches further out of the block, across or along
  float z_min_mm = 0;
  float z_max_mm = 0;
  std::vector<Piece> pieces;
  std::vector<TreeNode> nodes;
};

}  // namespace weft::transport
