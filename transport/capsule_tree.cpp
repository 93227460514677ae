#include "transport/capsule_tree.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace weft::transport {

namespace {

constexpr float kPieceRadii = 8;
constexpr std::uint32_t kLeafPieces = 4;
constexpr double kMaxPieces = 1 << 25;

glm::vec3 middle(const Piece& piece) {
  return piece.start_mm + 0.5f * piece.length_mm * piece.axis;
}

// Children are built by a stack, not by recursion: a subtree is (node, first piece, one past last).
struct Task {
  std::uint32_t node;
  std::uint32_t first;
  std::uint32_t last;
};

// Splits at the median of the longest axis of the middles; ties are broken by the axis' order and
// the order that nth_element leaves, which is the same everywhere for one standard library.
std::uint32_t split(std::vector<Piece>& pieces, const Task& task) {
  glm::vec3 low(1e30f);
  glm::vec3 high(-1e30f);
  for (std::uint32_t i = task.first; i < task.last; ++i) {
    low = glm::min(low, middle(pieces[i]));
    high = glm::max(high, middle(pieces[i]));
  }
  const glm::vec3 extent = high - low;
  const int axis =
      extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
  const std::uint32_t half = task.first + (task.last - task.first) / 2;
  std::nth_element(
      pieces.begin() + task.first, pieces.begin() + half, pieces.begin() + task.last,
      [axis](const Piece& a, const Piece& b) { return middle(a)[axis] < middle(b)[axis]; });
  return half;
}

TreeNode ball_of(const std::vector<Piece>& pieces, const Task& task) {
  glm::vec3 low(1e30f);
  glm::vec3 high(-1e30f);
  for (std::uint32_t i = task.first; i < task.last; ++i) {
    const glm::vec3 end = pieces[i].start_mm + pieces[i].length_mm * pieces[i].axis;
    low = glm::min(low, glm::min(pieces[i].start_mm, end) - pieces[i].radius_mm);
    high = glm::max(high, glm::max(pieces[i].start_mm, end) + pieces[i].radius_mm);
  }
  TreeNode node{0.5f * (low + high), 0, task.first, task.last - task.first};
  for (std::uint32_t i = task.first; i < task.last; ++i) {
    const glm::vec3 end = pieces[i].start_mm + pieces[i].length_mm * pieces[i].axis;
    const float reach = std::max(glm::distance(pieces[i].start_mm, node.centre_mm),
                                 glm::distance(end, node.centre_mm));
    node.radius_mm = std::max(node.radius_mm, (reach + pieces[i].radius_mm) * 1.00001f);
  }
  return node;
}

void add_pieces(const Scene& scene, std::uint32_t k, glm::ivec2 tile_of_block,
                std::vector<Piece>& pieces) {
  const fabric::Tile& tile = scene.tile();
  const fabric::Segment s = tile.segment(k);
  const glm::vec3 along = s.b_mm - s.a_mm;
  const float length = glm::length(along);
  const glm::vec3 axis = length > 0 ? along / length : glm::vec3{1, 0, 0};
  const glm::vec3 start = tile.wrapped_midpoint(k) - 0.5f * along +
                          glm::vec3(static_cast<float>(tile_of_block.x) * tile.size_mm.x,
                                    static_cast<float>(tile_of_block.y) * tile.size_mm.y, 0);
  const StrandCopy own = scene.own_copy(k);
  const int count = std::max(1, static_cast<int>(std::ceil(length / (kPieceRadii * s.radius_mm))));
  const float step = length / static_cast<float>(count);
  for (int i = 0; i < count; ++i) {
    pieces.push_back({start + static_cast<float>(i) * step * axis,
                      axis,
                      step,
                      s.radius_mm,
                      {own.strand, own.tile_x + tile_of_block.x, own.tile_y + tile_of_block.y}});
  }
}

}  // namespace

CapsuleTree::CapsuleTree(const Scene& scene) {
  const fabric::Tile& tile = scene.tile();
  z_min_mm = 1e30f;
  z_max_mm = -1e30f;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::vec3 half = 0.5f * glm::abs(s.b_mm - s.a_mm);
    overhang_mm = std::max(overhang_mm, std::max(half.x, half.y) + s.radius_mm);
    z_min_mm = std::min(z_min_mm, std::min(s.a_mm.z, s.b_mm.z) - s.radius_mm);
    z_max_mm = std::max(z_max_mm, std::max(s.a_mm.z, s.b_mm.z) + s.radius_mm);
  }
  const double reach = std::max(z_max_mm - z_min_mm, 2 * overhang_mm);
  for (int axis = 0; axis < 2; ++axis) {
    const double most = std::sqrt(kMaxPieces / tile.segment_count());
    tiles[axis] = static_cast<int>(std::clamp(
        std::ceil(reach / static_cast<double>(tile.size_mm[axis])), 1.0, std::max(1.0, most)));
    size_mm[axis] = tiles[axis] * static_cast<double>(tile.size_mm[axis]);
  }
  for (int y = 0; y < tiles.y; ++y) {
    for (int x = 0; x < tiles.x; ++x) {
      for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
        add_pieces(scene, k, {x, y}, pieces);
      }
    }
  }
  nodes.emplace_back();
  std::vector<Task> stack{{0, 0, static_cast<std::uint32_t>(pieces.size())}};
  while (!stack.empty()) {
    const Task task = stack.back();
    stack.pop_back();
    nodes[task.node] = ball_of(pieces, task);
    if (task.last - task.first > kLeafPieces) {
      const std::uint32_t half = split(pieces, task);
      const auto children = static_cast<std::uint32_t>(nodes.size());
      nodes[task.node].first = children;
      nodes[task.node].count = 0;
      nodes.emplace_back();
      nodes.emplace_back();
      stack.push_back({children, task.first, half});
      stack.push_back({children + 1, half, task.last});
    }
  }
}

}  // namespace weft::transport
