#include "render/gpu/bounds_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include <glm/common.hpp>

#include "core/check.h"

namespace weft::render::gpu {
namespace {

constexpr std::uint32_t kLeafBoxes = 4;
constexpr int kBins = 16;
// From here on down nodes are halved: with at most 2^23 boxes the tree then stays below the 48
// levels of the kernels' stack (kTreeStack).
constexpr int kHeuristicDepth = 20;

Box empty_box() {
  constexpr float kHuge = std::numeric_limits<float>::max();
  return {glm::vec3(kHuge), glm::vec3(-kHuge)};
}

Box both(const Box& a, const Box& b) {
  return {glm::min(a.low_mm, b.low_mm), glm::max(a.high_mm, b.high_mm)};
}

float half_area(const Box& box) {
  const glm::vec3 size = box.high_mm - box.low_mm;
  return size.x < 0 ? 0.0f : size.x * size.y + size.y * size.z + size.z * size.x;
}

glm::vec3 twice_centre(const Box& box) { return box.low_mm + box.high_mm; }

// A subtree to be built: its node, the run of boxes it holds, and how deep it lies.
struct Task {
  std::uint32_t node;
  std::uint32_t first;
  std::uint32_t last;
  int depth;
};

class Builder {
 public:
  explicit Builder(std::span<const Box> boxes) : boxes_(boxes), tree_{{}, {}} {
    tree_.order.resize(boxes.size());
    std::iota(tree_.order.begin(), tree_.order.end(), 0U);
  }

  BoundsTree build() {
    tree_.nodes.emplace_back();
    std::vector<Task> tasks{{0, 0, static_cast<std::uint32_t>(boxes_.size()), 0}};
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      set_bounds(task);
      if (task.last - task.first <= kLeafBoxes) {
        continue;
      }
      const int axis = longest_axis(task);
      const std::uint32_t middle = split(task, axis);
      const auto children = static_cast<std::uint32_t>(tree_.nodes.size());
      tree_.nodes[task.node].first = static_cast<int>(children);
      tree_.nodes[task.node].count = -1 - axis;
      tree_.nodes.resize(children + 2);
      tasks.push_back({children, task.first, middle, task.depth + 1});
      tasks.push_back({children + 1, middle, task.last, task.depth + 1});
    }
    return std::move(tree_);
  }

 private:
  [[nodiscard]] const Box& box(std::uint32_t i) const { return boxes_[tree_.order[i]]; }

  void set_bounds(const Task& task) {
    Box bounds = empty_box();
    for (std::uint32_t i = task.first; i < task.last; ++i) {
      bounds = both(bounds, box(i));
    }
    shading::DeviceNode& node = tree_.nodes[task.node];
    node.low_mm = bounds.low_mm;
    node.high_mm = bounds.high_mm;
    node.first = static_cast<int>(task.first);
    node.count = static_cast<int>(task.last - task.first);
  }

  [[nodiscard]] Box centres_of(const Task& task) const {
    Box centres = empty_box();
    for (std::uint32_t i = task.first; i < task.last; ++i) {
      const glm::vec3 centre = twice_centre(box(i));
      centres = both(centres, {centre, centre});
    }
    return centres;
  }

  [[nodiscard]] int longest_axis(const Task& task) const {
    const Box centres = centres_of(task);
    const glm::vec3 extent = centres.high_mm - centres.low_mm;
    return extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
  }

  // Orders the boxes of a task so that its children are two runs, the lower ones along the axis
  // first; returns where the second begins.
  std::uint32_t split(const Task& task, int axis) {
    const Box centres = centres_of(task);
    const glm::vec3 extent = centres.high_mm - centres.low_mm;
    const auto first = tree_.order.begin() + task.first;
    const auto last = tree_.order.begin() + task.last;
    if (task.depth < kHeuristicDepth && extent[axis] > 0) {
      const auto bin_of = [&](std::uint32_t index) {
        const float at = (twice_centre(boxes_[index])[axis] - centres.low_mm[axis]) / extent[axis];
        return std::clamp(static_cast<int>(at * kBins), 0, kBins - 1);
      };
      const int border = cheapest_border(task, bin_of);
      const auto middle = std::stable_partition(
          first, last, [&](std::uint32_t index) { return bin_of(index) < border; });
      if (middle != first && middle != last) {
        return static_cast<std::uint32_t>(middle - tree_.order.begin());
      }
    }
    const auto middle = first + (task.last - task.first) / 2;
    std::nth_element(first, middle, last, [&](std::uint32_t a, std::uint32_t b) {
      const float at_a = twice_centre(boxes_[a])[axis];
      const float at_b = twice_centre(boxes_[b])[axis];
      return at_a < at_b || (at_a == at_b && a < b);
    });
    return static_cast<std::uint32_t>(middle - tree_.order.begin());
  }

  template <class BinOf>
  [[nodiscard]] int cheapest_border(const Task& task, const BinOf& bin_of) const {
    std::array<Box, kBins> bounds;
    std::array<int, kBins> counts{};
    bounds.fill(empty_box());
    for (std::uint32_t i = task.first; i < task.last; ++i) {
      const auto bin = static_cast<std::size_t>(bin_of(tree_.order[i]));
      bounds[bin] = both(bounds[bin], box(i));
      ++counts[bin];
    }
    std::array<float, kBins> upper_cost{};  // of the bins from here on
    Box above = empty_box();
    int above_count = 0;
    for (std::size_t bin = kBins - 1; bin > 0; --bin) {
      above = both(above, bounds[bin]);
      above_count += counts[bin];
      upper_cost[bin] = half_area(above) * static_cast<float>(above_count);
    }
    Box below = empty_box();
    int below_count = 0;
    int best = kBins / 2;
    float best_cost = std::numeric_limits<float>::max();
    for (std::size_t bin = 1; bin < kBins; ++bin) {
      below = both(below, bounds[bin - 1]);
      below_count += counts[bin - 1];
      const float cost = half_area(below) * static_cast<float>(below_count) + upper_cost[bin];
      if (below_count > 0 && cost < best_cost) {
        best_cost = cost;
        best = static_cast<int>(bin);
      }
    }
    return best;
  }

  std::span<const Box> boxes_;
  BoundsTree tree_;
};

}  // namespace

BoundsTree build_bounds_tree(std::span<const Box> boxes) {
  CHECK(!boxes.empty());
  return Builder(boxes).build();
}

}  // namespace weft::render::gpu
