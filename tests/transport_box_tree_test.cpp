#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "core/random.h"
#include "transport/box_tree.h"

namespace weft::transport {
namespace {

std::vector<Box> random_boxes(std::uint32_t count) {
  std::vector<Box> boxes;
  for (std::uint32_t i = 0; i < count; ++i) {
    core::Random random(1, i);
    const float x = random.uniform();
    const float y = random.uniform();
    const glm::vec3 low{x, y, random.uniform()};
    boxes.push_back({low, low + 0.1f * random.uniform()});
  }
  return boxes;
}

bool holds(const BoxNode& node, std::size_t lane, const Box& box) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    if (box.low[axis] < node.bounds[i][lane] || box.high[axis] > node.bounds[i + 3][lane]) {
      return false;
    }
  }
  return true;
}

// Every box is an item of one leaf, inside the bounds of all nodes above it, and none lies deeper
// than it may.
void expect_sound(const std::vector<Box>& boxes) {
  const BoxTree tree = build_box_tree(boxes);
  ASSERT_EQ(tree.order.size(), boxes.size());
  std::vector<int> met(boxes.size(), 0);
  std::uint32_t deepest = 0;
  // The boxes below a child, after the subtree was looked at.
  const std::function<std::vector<std::uint32_t>(std::uint32_t, std::uint32_t)> below =
      [&](std::uint32_t child, std::uint32_t depth) {
        deepest = std::max(deepest, depth);
        std::vector<std::uint32_t> items;
        if ((child & BoxTree::kLeaf) != 0) {
          const BoxTree::Leaf leaf = tree.leaves.at(child & ~BoxTree::kLeaf);
          EXPECT_GE(leaf.count, 1U);
          EXPECT_LE(leaf.count, kTreeWidth);
          for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) {
            items.push_back(tree.order.at(i));
            ++met.at(tree.order.at(i));
          }
          return items;
        }
        const BoxNode& node = tree.nodes.at(child);
        for (std::size_t lane = 0; lane < kTreeWidth; ++lane) {
          if (!(node.bounds[0][lane] <= node.bounds[3][lane])) {
            continue;
          }
          for (const std::uint32_t item : below(node.child[lane], depth + 1)) {
            EXPECT_TRUE(holds(node, lane, boxes[item])) << item;
            items.push_back(item);
          }
        }
        return items;
      };
  EXPECT_EQ(below(tree.root, 0).size(), boxes.size());
  EXPECT_EQ(std::count(met.begin(), met.end(), 1), static_cast<std::ptrdiff_t>(boxes.size()));
  EXPECT_LT(deepest, BoxTree::kMaxDepth);
}

TEST(TransportBoxTree, EveryBox_IsInOneLeafInsideItsNodes) {
  for (const std::uint32_t count : {1U, 2U, 16U, 17U, 300U, 5000U}) {
    expect_sound(random_boxes(count));
  }
}

TEST(TransportBoxTree, BoxesWithOneMiddle_AreHalved) {
  expect_sound(std::vector<Box>(1000, Box{{0, 0, 0}, {1, 1, 1}}));
}

TEST(TransportBoxTree, BoxesThatShrinkTowardsAPoint_MakeNoDeepTree) {
  // Each split of bins takes few of these from the rest.
  std::vector<Box> boxes;
  float at = 1;
  for (int i = 0; i < 2000; ++i) {
    boxes.push_back({{at, 0, 0}, {at, 0, 0}});
    at *= 0.96f;
  }
  expect_sound(boxes);
}

TEST(TransportBoxTree, BoxesWhoseAreaIsNoNumber_MakeATreeAllTheSame) {
  std::vector<Box> boxes;
  for (int i = 0; i < 100; ++i) {
    const float at = 1e25f * static_cast<float>(i);
    boxes.push_back({{at, -at, at}, {2 * at, at, 1.5f * at}});
  }
  expect_sound(boxes);
}

TEST(TransportBoxTree, SparseNodes_HaveLanesThatHoldNothing) {
  const BoxNode node;
  for (std::size_t lane = 0; lane < kTreeWidth; ++lane) {
    EXPECT_GT(node.bounds[0][lane], node.bounds[3][lane]);
  }
}

}  // namespace
}  // namespace weft::transport
