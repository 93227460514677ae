#include "transport/fibre_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace weft::transport {

namespace {

// Boxes are wider than their capsules by this share of the longest way through 3 x 3 blocks: some
// ten times what rounding moves a hit off its capsule, or a ray off a box's side. So a hit is never
// lost to the hierarchy, and never found in one order of search only.
constexpr float kPadding = 1e-6f;

struct Capsule {
  glm::vec3 middle;
  glm::vec3 half;  // from the middle to an end
  float radius;
};

Box box_of(const Capsule& capsule, float padding) {
  const glm::vec3 reach = glm::abs(capsule.half) + capsule.radius + padding;
  return {capsule.middle - reach, capsule.middle + reach};
}

// All capsules of a block, by id.
std::vector<Capsule> capsules_of(const EndlessTile& endless) {
  const fabric::Tile& tile = endless.tile;
  std::vector<Capsule> capsules;
  capsules.reserve(std::size_t{tile.segment_count()} *
                   static_cast<std::size_t>(endless.copies.x * endless.copies.y));
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::vec3 middle = tile.wrapped_midpoint(k);
    for (int y = 0; y < endless.copies.y; ++y) {
      for (int x = 0; x < endless.copies.x; ++x) {
        const glm::vec3 corner{static_cast<float>(x) * tile.size_mm.x,
                               static_cast<float>(y) * tile.size_mm.y, 0};
        capsules.push_back({middle + corner, 0.5f * (s.b_mm - s.a_mm), s.radius_mm});
      }
    }
  }
  return capsules;
}

void set_lane(CapsuleBlock& block, std::size_t lane, const Capsule& capsule, std::uint32_t id) {
  const float half_length = glm::length(capsule.half);
  const glm::vec3 axis = half_length > 0 ? capsule.half / half_length : glm::vec3{1, 0, 0};
  for (int i = 0; i < 3; ++i) {
    block.middle[static_cast<std::size_t>(i)][lane] = capsule.middle[i];
    block.axis[static_cast<std::size_t>(i)][lane] = axis[i];
  }
  block.half_length[lane] = half_length;
  block.radius[lane] = capsule.radius;
  block.id[lane] = id;
}

}  // namespace

CapsuleBlock::CapsuleBlock() : middle{}, axis{}, half_length{}, radius{}, strand{}, id{} {
  for (int i = 0; i < 3; ++i) {
    middle[static_cast<std::size_t>(i)].fill(std::numeric_limits<float>::quiet_NaN());
    axis[static_cast<std::size_t>(i)].fill(std::numeric_limits<float>::quiet_NaN());
  }
}

FibreTree::FibreTree(const EndlessTile& endless_in)
    : endless(endless_in),
      tiles_in_block(static_cast<std::uint32_t>(endless.copies.x * endless.copies.y)),
      step_mm{} {
  const fabric::Tile& tile = endless.tile;
  const std::vector<Capsule> capsules = capsules_of(endless);
  const glm::vec2 block_size(endless.block_size_mm);
  const float padding =
      kPadding * (2 * (block_size.x + block_size.y) + (endless.z_max_mm - endless.z_min_mm));
  std::vector<Box> boxes;
  boxes.reserve(capsules.size());
  for (const Capsule& capsule : capsules) {
    boxes.push_back(box_of(capsule, padding));
  }
  BoxTree tree = build_box_tree(boxes);
  nodes = std::move(tree.nodes);
  leaves.resize(tree.leaves.size());
  for (std::size_t l = 0; l < leaves.size(); ++l) {
    for (std::uint32_t lane = 0; lane < tree.leaves[l].count; ++lane) {
      const std::uint32_t id = tree.order[tree.leaves[l].first + lane];
      set_lane(leaves[l], lane, capsules[id], id);
      leaves[l].strand[lane] = tile.segment_strand[segment_of(id)];
    }
  }
  home.reserve(tile.segment_count());
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    home.push_back(endless.tile_of_midpoint(k));
  }
  for (std::uint32_t i = 0; i < kBlocks; ++i) {
    const std::uint32_t row = i / 3;
    step_mm[i] = {(static_cast<float>(i % 3) - 1) * block_size.x,
                  (static_cast<float>(row) - 1) * block_size.y, 0};
    top.set(i, {tree.bounds.low + step_mm[i], tree.bounds.high + step_mm[i]},
            tree.root | i << kBlockShift);
  }
}

StrandCopy FibreTree::copy_of(std::uint32_t id, std::uint32_t block) const {
  const std::uint32_t segment = segment_of(id);
  glm::ivec2 at =
      glm::ivec2(block % 3, block / 3) * endless.copies - endless.copies - home[segment];
  if (tiles_in_block != 1) {
    const int in_block = static_cast<int>(id - segment * tiles_in_block);
    at += glm::ivec2(in_block % endless.copies.x, in_block / endless.copies.x);
  }
  const std::uint32_t strand = endless.tile.segment_strand[segment];
  return reduced({strand, at.x, at.y}, endless.tile.strands[strand]);
}

std::size_t FibreTree::size_bytes() const {
  return nodes.size() * sizeof(BoxNode) + leaves.size() * sizeof(CapsuleBlock) +
         home.size() * sizeof(glm::ivec2);
}

}  // namespace weft::transport
