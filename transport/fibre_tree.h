#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "transport/box_tree.h"
#include "transport/endless_tile.h"
#include "transport/strand_copy.h"

namespace weft::transport {

// Up to 16 capsules side by side: the points within `radius` of the line of unit direction `axis`
// that reaches half_length to both sides of `middle`. A lane without a capsule is NaN, which no
// ray meets. `id` is segment * tiles in a block + the segment's tile in the block.
struct alignas(64) CapsuleBlock {
  using Lanes = std::array<float, kTreeWidth>;

  std::array<Lanes, 3> middle;
  std::array<Lanes, 3> axis;
  Lanes half_length;
  Lanes radius;
  std::array<std::uint32_t, kTreeWidth> strand;
  std::array<std::uint32_t, kTreeWidth> id;

  CapsuleBlock();
};

// The capsules of one block of endless cloth in a hierarchy, and how 3 x 3 such blocks stand side
// by side: number i is moved by step_mm[i], and number 4 is the block that holds the origin.
// Immutable when built.
struct FibreTree {
  static constexpr std::uint32_t kBlocks = 9;
  static constexpr std::uint32_t kBlockShift =
      27;  // a child of `top` is root | block << kBlockShift
  static constexpr std::size_t kMaxStack = std::size_t{BoxTree::kMaxDepth + 1} * kTreeWidth;

  explicit FibreTree(const EndlessTile& endless_in);

  const EndlessTile& endless;
  std::uint32_t tiles_in_block;
  BoxNode top;  // the blocks
  std::array<glm::vec3, kBlocks> step_mm;
  std::vector<BoxNode> nodes;
  std::vector<CapsuleBlock> leaves;
  std::vector<glm::ivec2> home;  // by segment: the tile in which its strand has its midpoint

  [[nodiscard]] std::uint32_t segment_of(std::uint32_t id) const {
    return tiles_in_block == 1 ? id : id / tiles_in_block;
  }
  // The fibre that capsule `id` of a block belongs to, in tiles relative to the central block.
  [[nodiscard]] StrandCopy copy_of(std::uint32_t id, std::uint32_t block) const;
  [[nodiscard]] std::size_t size_bytes() const;
};

}  // namespace weft::transport
