#include "transport/box_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include <glm/common.hpp>

#include "core/check.h"

namespace weft::transport {

namespace {

constexpr std::uint32_t kBins = 16;
// Below this depth of the binary tree items are halved, so that no tree is deeper than kMaxDepth.
constexpr std::uint32_t kMaxHeuristicDepth = 36;
constexpr std::uint32_t kMaxBoxes = std::uint32_t{1} << 27;

// A subtree of the binary tree: its items are order[first] and the next ones.
struct Branch {
  Box box;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::uint32_t children = 0;  // the first of two; 0: a leaf
  std::uint32_t depth = 0;
};

// What a branch costs in i + 1 places of a node, and how many of these its left child has; zero:
// the branch is one child itself. Of the last entry the left child's share always counts.
struct Plan {
  std::array<float, kTreeWidth> steps{};
  std::array<std::uint8_t, kTreeWidth> left_places{};
};

struct Bin {
  Box box;
  std::uint32_t count = 0;
};

// Items whose bin along the axis is less than `bin` go to the left; bin 0: no split was found.
struct Split {
  int axis = 0;
  std::uint32_t bin = 0;
  float cost = std::numeric_limits<float>::infinity();
};

glm::vec3 twice_middle(const Box& box) { return box.low + box.high; }

float leaves_for(std::uint32_t count) {
  const std::uint32_t leaves = (count + kTreeWidth - 1) / kTreeWidth;
  return static_cast<float>(leaves);
}

// Maps an item's middle to a bin along each axis.
struct Binning {
  explicit Binning(const Box& middles) : low(middles.low) {
    for (int axis = 0; axis < 3; ++axis) {
      const float extent = middles.high[axis] - middles.low[axis];
      scale[axis] = extent > 0 ? 0.9999f * kBins / extent : 0.0f;
    }
  }
  [[nodiscard]] std::uint32_t bin(const Box& box, int axis) const {
    const float at = (box.low[axis] + box.high[axis] - low[axis]) * scale[axis];
    return std::min(static_cast<std::uint32_t>(at), kBins - 1);
  }
  glm::vec3 low;
  glm::vec3 scale{0, 0, 0};
};

Split best_split(const std::array<std::array<Bin, kBins>, 3>& bins, const Binning& binning) {
  Split best;
  for (int axis = 0; axis < 3; ++axis) {
    if (binning.scale[axis] == 0) {
      continue;
    }
    const auto& along = bins[static_cast<std::size_t>(axis)];
    std::array<float, kBins> right_cost{};
    Bin right;
    for (std::uint32_t i = kBins - 1; i > 0; --i) {
      right.box.add(along[i].box);
      right.count += along[i].count;
      right_cost[i] = right.count == 0 ? std::numeric_limits<float>::infinity()
                                       : right.box.half_area() * leaves_for(right.count);
    }
    Bin left;
    for (std::uint32_t i = 1; i < kBins; ++i) {
      left.box.add(along[i - 1].box);
      left.count += along[i - 1].count;
      if (left.count == 0) {
        continue;
      }
      const float cost = left.box.half_area() * leaves_for(left.count) + right_cost[i];
      if (cost < best.cost) {
        best = {axis, i, cost};
      }
    }
  }
  return best;
}

class Builder {
 public:
  explicit Builder(std::span<const Box> boxes) : boxes_(boxes) {
    tree_.order.resize(boxes.size());
    std::iota(tree_.order.begin(), tree_.order.end(), 0U);
  }

  BoxTree build() {
    grow_branches();
    plan_nodes();
    tree_.bounds = branches_[0].box;
    tree_.root = to_child(0);
    // Nodes are made as they are met: a child is known before the subtree below it is.
    for (std::size_t i = 0; i < pending_.size(); ++i) {
      make_node(static_cast<std::uint32_t>(i), pending_[i]);
    }
    return std::move(tree_);
  }

 private:
  void grow_branches() {
    branches_.push_back({{}, 0, static_cast<std::uint32_t>(boxes_.size()), 0, 0});
    // New branches stand behind those that wait.
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      Branch branch = branches_[i];
      const std::uint32_t left = split(branch);
      if (left > 0) {
        branch.children = static_cast<std::uint32_t>(branches_.size());
        branches_.push_back({{}, branch.first, left, 0, branch.depth + 1});
        branches_.push_back({{}, branch.first + left, branch.count - left, 0, branch.depth + 1});
      }
      branches_[i] = branch;
    }
  }

  // Finds the branch's box and orders its items; returns how many of them go to the left child,
  // zero for a leaf.
  std::uint32_t split(Branch& branch) {
    Box middles;
    const auto items = std::span(tree_.order).subspan(branch.first, branch.count);
    for (const std::uint32_t item : items) {
      branch.box.add(boxes_[item]);
      middles.add(twice_middle(boxes_[item]));
    }
    if (branch.count <= kTreeWidth) {
      return 0;
    }
    const Binning binning(middles);
    std::array<std::array<Bin, kBins>, 3> bins{};
    for (const std::uint32_t item : items) {
      for (int axis = 0; axis < 3; ++axis) {
        Bin& bin = bins[static_cast<std::size_t>(axis)][binning.bin(boxes_[item], axis)];
        bin.box.add(boxes_[item]);
        ++bin.count;
      }
    }
    const Split best = best_split(bins, binning);
    if (best.bin == 0 || branch.depth >= kMaxHeuristicDepth) {
      return branch.count / 2;
    }
    const auto middle = std::stable_partition(items.begin(), items.end(), [&](std::uint32_t item) {
      return binning.bin(boxes_[item], best.axis) < best.bin;
    });
    return static_cast<std::uint32_t>(middle - items.begin());
  }

  // The child that stands for a branch: a new leaf, or a node to be made.
  std::uint32_t to_child(std::uint32_t branch) {
    if (branches_[branch].children == 0) {
      tree_.leaves.push_back({branches_[branch].first, branches_[branch].count});
      return BoxTree::kLeaf | static_cast<std::uint32_t>(tree_.leaves.size() - 1);
    }
    pending_.push_back(branch);
    return static_cast<std::uint32_t>(pending_.size() - 1);
  }

  // From the leaves up: the least expected number of steps below a branch, per area, when it may
  // take up to 1, 2, ..., 16 places of a node. It takes one as a leaf or a node of its own, or its
  // children share the places. A step is a node or a leaf that a ray meets, which it does in
  // proportion to the surface area.
  void plan_nodes() {
    plans_.resize(branches_.size());
    for (std::size_t b = branches_.size(); b-- > 0;) {
      const Branch& branch = branches_[b];
      const float area = branch.box.half_area();
      if (branch.children == 0) {
        plans_[b].steps.fill(area);
      } else {
        plans_[b] = plan_of(area, plans_[branch.children], plans_[branch.children + 1]);
      }
    }
  }

  static Plan plan_of(float area, const Plan& left, const Plan& right) {
    Plan plan;
    for (std::size_t places = 2; places <= kTreeWidth; ++places) {
      float least = std::numeric_limits<float>::infinity();
      plan.left_places[places - 1] = 1;  // where areas are too large to be told apart
      for (std::size_t k = 1; k < places; ++k) {
        const float steps = left.steps[k - 1] + right.steps[places - k - 1];
        if (steps < least) {
          least = steps;
          plan.left_places[places - 1] = static_cast<std::uint8_t>(k);
        }
      }
      plan.steps[places - 1] = least;
    }
    plan.steps[0] = area + plan.steps[kTreeWidth - 1];
    for (std::size_t i = 1; i + 1 < kTreeWidth; ++i) {
      if (plan.steps[0] < plan.steps[i]) {
        plan.steps[i] = plan.steps[0];
        plan.left_places[i] = 0;
      }
    }
    return plan;
  }

  // Adds the children of a node that stand for a branch in this many places.
  void gather(std::uint32_t branch, std::size_t places, std::vector<std::uint32_t>& members) const {
    const std::size_t left = plans_[branch].left_places[places - 1];
    if (left == 0) {
      members.push_back(branch);
      return;
    }
    gather(branches_[branch].children, left, members);
    gather(branches_[branch].children + 1, places - left, members);
  }

  void make_node(std::uint32_t index, std::uint32_t branch) {
    const std::uint32_t children = branches_[branch].children;
    const std::size_t left = plans_[branch].left_places[kTreeWidth - 1];
    std::vector<std::uint32_t> members;
    gather(children, left, members);
    gather(children + 1, kTreeWidth - left, members);
    CHECK_EQ(std::size_t{index}, tree_.nodes.size());
    BoxNode& node = tree_.nodes.emplace_back();
    for (std::size_t i = 0; i < members.size(); ++i) {
      node.set(i, branches_[members[i]].box, to_child(members[i]));
    }
  }

  std::span<const Box> boxes_;
  std::vector<Branch> branches_;
  std::vector<Plan> plans_;
  std::vector<std::uint32_t> pending_;  // branches of the nodes, by the nodes' indices
  BoxTree tree_;
};

}  // namespace

void Box::add(const glm::vec3& point) {
  low = glm::min(low, point);
  high = glm::max(high, point);
}

void Box::add(const Box& other) {
  low = glm::min(low, other.low);
  high = glm::max(high, other.high);
}

float Box::half_area() const {
  const glm::vec3 size = high - low;
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

BoxNode::BoxNode() : bounds{}, child{} {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    bounds[axis].fill(kInfinity);
    bounds[axis + 3].fill(-kInfinity);
  }
}

void BoxNode::set(std::size_t lane, const Box& box, std::uint32_t child_in) {
  for (int axis = 0; axis < 3; ++axis) {
    bounds[static_cast<std::size_t>(axis)][lane] = box.low[axis];
    bounds[static_cast<std::size_t>(axis) + 3][lane] = box.high[axis];
  }
  child[lane] = child_in;
}

BoxTree build_box_tree(std::span<const Box> boxes) {
  CHECK(!boxes.empty() && boxes.size() < kMaxBoxes);
  return Builder(boxes).build();
}

}  // namespace weft::transport
