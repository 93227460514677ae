#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"
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

// A ball round the pieces of a subtree. Inner nodes have their children at `first` and first + 1.
struct TreeNode {
  glm::vec3 centre_mm;
  float radius_mm;
  std::uint32_t first;
  std::uint32_t count;  // pieces of a leaf; 0: an inner node
};

// The capsules of one block (as many tiles as make it at least as long as it is thick, or 1) in a
// hierarchy of balls, the root at nodes[0]. The same for the same tile.
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
