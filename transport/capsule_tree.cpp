#include "transport/capsule_tree.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace weft::transport {

namespace {

constexpr float kPieceRadii = 8;
constexpr std::uint32_t kLanes = Balls::kCount;
constexpr double kMaxPieces = 1 << 25;

glm::vec3 middle(const Piece& piece) {
  return piece.start_mm + 0.5f * piece.length_mm * piece.axis;
}

// Pieces first ... last - 1, which are to be a node or, when there are few, a leaf.
struct Range {
  std::uint32_t first;
  std::uint32_t last;
  [[nodiscard]] std::uint32_t count() const { return last - first; }
};

// Splits near the median of the longest axis of the middles, so that the lower part fills its
// leaves; ties are broken by the axis' order and the order that nth_element leaves, which is the
// same everywhere for one standard library.
std::uint32_t split(std::vector<Piece>& pieces, const Range& range) {
  glm::vec3 low(1e30f);
  glm::vec3 high(-1e30f);
  for (std::uint32_t i = range.first; i < range.last; ++i) {
    low = glm::min(low, middle(pieces[i]));
    high = glm::max(high, middle(pieces[i]));
  }
  const glm::vec3 extent = high - low;
  const int axis =
      extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
  const std::uint32_t leaves = (range.count() + kLanes - 1) / kLanes;
  const std::uint32_t half = range.first + leaves / 2 * kLanes;
  std::nth_element(
      pieces.begin() + range.first, pieces.begin() + half, pieces.begin() + range.last,
      [axis](const Piece& a, const Piece& b) { return middle(a)[axis] < middle(b)[axis]; });
  return half;
}

// Splits the range with the most pieces until there are sixteen, or all are leaves.
std::vector<Range> children_of(std::vector<Piece>& pieces, const Range& range) {
  std::vector<Range> children{range};
  while (children.size() < kLanes) {
    const auto largest =
        std::max_element(children.begin(), children.end(),
                         [](const Range& a, const Range& b) { return a.count() < b.count(); });
    if (largest->count() <= kLanes) {
      break;
    }
    const std::uint32_t half = split(pieces, *largest);
    const Range upper{half, largest->last};
    largest->last = half;
    children.insert(largest + 1, upper);
  }
  return children;
}

void set_ball(Balls& balls, std::size_t lane, glm::vec3 centre, float radius) {
  balls.x[lane] = centre.x;
  balls.y[lane] = centre.y;
  balls.z[lane] = centre.z;
  balls.radius[lane] = radius * 1.00001f;
}

void set_ball_of_pieces(const std::vector<Piece>& pieces, const Range& range, Balls& balls,
                        std::size_t lane) {
  glm::vec3 low(1e30f);
  glm::vec3 high(-1e30f);
  for (std::uint32_t i = range.first; i < range.last; ++i) {
    const glm::vec3 end = pieces[i].start_mm + pieces[i].length_mm * pieces[i].axis;
    low = glm::min(low, glm::min(pieces[i].start_mm, end) - pieces[i].radius_mm);
    high = glm::max(high, glm::max(pieces[i].start_mm, end) + pieces[i].radius_mm);
  }
  const glm::vec3 centre = 0.5f * (low + high);
  float radius = 0;
  for (std::uint32_t i = range.first; i < range.last; ++i) {
    const glm::vec3 end = pieces[i].start_mm + pieces[i].length_mm * pieces[i].axis;
    const float reach =
        std::max(glm::distance(pieces[i].start_mm, centre), glm::distance(end, centre));
    radius = std::max(radius, reach + pieces[i].radius_mm);
  }
  set_ball(balls, lane, centre, radius);
}

TreeNode leaf_of(const std::vector<Piece>& pieces, const Range& range) {
  TreeNode leaf{{}, range.first, range.count(), true};
  for (std::uint32_t i = 0; i < range.count(); ++i) {
    const Piece& piece = pieces[range.first + i];
    set_ball(leaf.balls_mm, i, middle(piece), 0.5f * piece.length_mm + piece.radius_mm);
  }
  return leaf;
}

// Nodes are made from the root on, those of one parent together.
std::vector<TreeNode> tree_of(std::vector<Piece>& pieces) {
  std::vector<TreeNode> nodes(1);
  std::vector<Range> ranges{{0, static_cast<std::uint32_t>(pieces.size())}};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (ranges[i].count() <= kLanes) {
      nodes[i] = leaf_of(pieces, ranges[i]);
      continue;
    }
    const std::vector<Range> children = children_of(pieces, ranges[i]);
    nodes[i] = {{},
                static_cast<std::uint32_t>(nodes.size()),
                static_cast<std::uint32_t>(children.size()),
                false};
    for (std::size_t c = 0; c < children.size(); ++c) {
      set_ball_of_pieces(pieces, children[c], nodes[i].balls_mm, c);
    }
    ranges.insert(ranges.end(), children.begin(), children.end());
    nodes.resize(ranges.size());
  }
  return nodes;
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
  nodes = tree_of(pieces);
}

}  // namespace weft::transport
