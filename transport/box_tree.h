#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::transport {

inline constexpr std::uint32_t kTreeWidth = 16;  // children of a node, items of a leaf: at most

struct Box {
  glm::vec3 low{1e30f};
  glm::vec3 high{-1e30f};

  void add(const glm::vec3& point);
  void add(const Box& other);
  [[nodiscard]] float half_area() const;
};

// The bounds of up to 16 children side by side. A lane without a child has bounds that no ray
// meets: from plus to minus infinity.
struct alignas(64) BoxNode {
  // Low x, y, z, then high x, y, z.
  std::array<std::array<float, kTreeWidth>, 6> bounds;
  std::array<std::uint32_t, kTreeWidth> child;

  BoxNode();
  void set(std::size_t lane, const Box& box, std::uint32_t child_in);
};

// A hierarchy of boxes, 16 wide. A child is the index of a node, or kLeaf plus the index of a leaf,
// which holds 1 to 16 consecutive items of `order`.
struct BoxTree {
  struct Leaf {
    std::uint32_t first;
    std::uint32_t count;
  };

  static constexpr std::uint32_t kLeaf = 0x80000000U;
  static constexpr std::uint32_t kMaxDepth = 64;  // nodes from the root down to a leaf

  std::vector<BoxNode> nodes;
  std::vector<std::uint32_t> order;
  std::vector<Leaf> leaves;
  std::uint32_t root = 0;  // a child
  Box bounds;
};

// Splits where the surface area heuristic finds it best (Wald 2007, On fast construction of SAH
// based bounding volume hierarchies: 16 bins along each axis), counting whole leaves of 16, and
// then makes those 16 wide nodes that leave the fewest steps to a ray (Ylitie, Karras, Laine 2017,
// Efficient incoherent ray traversal on GPUs through compressed wide BVHs, section 3.1). The same
// for the same boxes. REQUIRES: at least one box and less than 2^27.
[[nodiscard]] BoxTree build_box_tree(std::span<const Box> boxes);

}  // namespace weft::transport
