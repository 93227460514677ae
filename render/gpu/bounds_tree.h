#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "render/kernels/cloth_records.h"

namespace weft::render::gpu {

struct Box {
  glm::vec3 low_mm{0, 0, 0};
  glm::vec3 high_mm{0, 0, 0};
};

// A bounding volume hierarchy over boxes, for render/kernels/outside.h: node 0 is the root, the two
// children of an inner node are neighbours, and a leaf holds a run of `order`.
struct BoundsTree {
  std::vector<shading::DeviceNode> nodes;
  std::vector<std::uint32_t> order;  // of the boxes
};

// Splits by the surface area heuristic (binned, Wald 2007), and at the median where the tree would
// become too deep for the kernels' stack. REQUIRES: at least one box.
[[nodiscard]] BoundsTree build_bounds_tree(std::span<const Box> boxes);

}  // namespace weft::render::gpu
