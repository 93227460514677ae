// How a ray is traced through a FibreTree, in the words of ray_lanes_portable.h or
// ray_lanes_wide.h: ray_kernel_portable.cpp and ray_kernel_wide.cpp include one of them and then
// this text, which is why there is no #pragma once and everything here is local to the including
// file.

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "transport/fibre_tree.h"
#include "transport/ray_kernel.h"

namespace weft::transport {
namespace {

struct Vector {
  Floats x;
  Floats y;
  Floats z;
};

WEFT_KERNEL Vector all(const glm::vec3& v) { return {all(v.x), all(v.y), all(v.z)}; }
WEFT_KERNEL Vector load(const std::array<CapsuleBlock::Lanes, 3>& v) {
  return {load(v[0].data()), load(v[1].data()), load(v[2].data())};
}
WEFT_KERNEL Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
WEFT_KERNEL Floats dot(Vector a, Vector b) {
  return multiply_add(a.z, b.z, multiply_add(a.y, b.y, a.x * b.x));
}
WEFT_KERNEL Vector cross(Vector a, Vector b) {
  return {multiply_subtract(a.y, b.z, a.z * b.y), multiply_subtract(a.z, b.x, a.x * b.z),
          multiply_subtract(a.x, b.y, a.y * b.x)};
}
// a s - b and c - s a.
WEFT_KERNEL Vector multiply_subtract(Vector a, Floats s, Vector b) {
  return {multiply_subtract(a.x, s, b.x), multiply_subtract(a.y, s, b.y),
          multiply_subtract(a.z, s, b.z)};
}
WEFT_KERNEL Vector subtract_product(Vector c, Floats s, Vector a) {
  return {subtract_product(c.x, s, a.x), subtract_product(c.y, s, a.y),
          subtract_product(c.z, s, a.z)};
}

// A ray against 16 capsules: lanes whose entry lies at 0 to t_max, and where.
struct Entries {
  Mask met;
  Floats t;
};

// Sine squared between ray and fibre below which the ray counts as running along the fibre: it can
// only enter by an end.
inline constexpr float kParallel = 1e-7f;

// Works from the ray's point nearest to the capsule's middle, so that what rounding costs does not
// grow with the way to there (Haines, Guenther, Akenine-Moeller 2019, Precision improvements for
// ray/sphere intersection). With p from the middle m to that point, unit direction d and axis u:
WEFT_KERNEL Entries enter_capsules(const CapsuleBlock& block, Vector origin, Vector d,
                                   Floats t_max) {
  const Vector to_middle = load(block.middle) - origin;
  const Vector u = load(block.axis);
  const Floats t_nearest = dot(to_middle, d);
  const Vector p = multiply_subtract(d, t_nearest, to_middle);
  // The line passes the axis at distance |p . (d x u)| / |d x u|.
  const Vector across = cross(d, u);
  const Floats sine2 = dot(across, across);
  const Floats passing = dot(p, across);
  const Floats radius = load(block.radius.data());
  const Floats radius2 = radius * radius;
  const Floats root2 = subtract_product(sine2 * radius2, passing, passing);
  const Mask parallel = is_less(sine2, all(kParallel));
  const Mask near = is_at_most(all(0), root2) | parallel;
  // Where it enters the endless cylinder: t sin^2 = -p . (d - (d . u) u) - root.
  const Floats cosine = dot(d, u);
  const Floats p_along = dot(p, u);
  const Floats b = subtract_product(dot(p, d), cosine, p_along);
  const Floats to_side = all(0) - b - square_root(greatest(root2, all(0)));
  const Floats t_side = to_side / sine2;
  // How far along the axis that is, times sin^2: the division need not be waited for.
  const Floats along = multiply_add(to_side, cosine, p_along * sine2);
  const Floats half_length = load(block.half_length.data());
  const Mask by_side = without(is_at_most(magnitude(along), half_length * sine2), parallel);
  // Into the ball at the end before which it enters the cylinder. Nearly every leaf has lanes of
  // both sorts: to branch on it costs more than it saves.
  const Floats side = choose(parallel, all(0) - cosine, along);
  const Vector from_end = subtract_product(p, with_sign(half_length, side), u);
  const Floats back = dot(from_end, d);
  const Vector off = subtract_product(from_end, back, d);
  const Floats h2 = radius2 - dot(off, off);
  const Floats t_end = all(0) - back - square_root(greatest(h2, all(0)));
  const Mask by_end = without(near, by_side) & is_at_most(all(0), h2);
  const Floats t_local = choose(by_side, t_side, t_end);
  const Floats t = t_nearest + t_local;
  return {((near & by_side) | by_end) & is_at_most(all(0), t) & is_at_most(t, t_max), t};
}

// Lanes whose capsule holds the origin.
WEFT_KERNEL Mask hold_origin(const CapsuleBlock& block, Vector origin) {
  const Vector from_middle = origin - load(block.middle);
  const Vector u = load(block.axis);
  const Floats half_length = load(block.half_length.data());
  const Floats along = dot(from_middle, u);
  const Floats clamped = greatest(least(along, half_length), all(0) - half_length);
  const Vector off = subtract_product(from_middle, clamped, u);
  const Floats radius = load(block.radius.data());
  return is_less(dot(off, off), radius * radius);
}

// A search: children that wait, the farthest first, each as the bits of the distance at which the
// ray enters its box (which order as the distances do) above the child itself.
template <bool kAny>
class Search {
 public:
  WEFT_KERNEL Search(const FibreTree& tree, const TreeRay& ray)
      : tree_(tree), ray_(ray), origin_(all(ray.origin_mm)), direction_(all(ray.direction)) {
    best_.t_mm = ray.t_max_mm;
    glm::vec3 inverse{0};
    for (int axis = 0; axis < 3; ++axis) {
      // Near enough to infinite where the direction is zero, but times zero it is no NaN.
      const float d = ray.direction[axis];
      inverse[axis] = 1 / (std::abs(d) > kLeast ? d : std::copysign(kLeast, d));
      near_[static_cast<std::size_t>(axis)] =
          static_cast<std::size_t>(inverse[axis] < 0 ? axis + 3 : axis);
    }
    inverse_ = all(inverse);
  }

  WEFT_KERNEL TreeHit run() {
    // The central block, where the ray starts, is entered at once.
    std::uint32_t current = FibreTree::kBlocks / 2;
    const std::uint32_t home = tree_.top.child[current];
    const bool is_node = (home & BoxTree::kLeaf) == 0;
    enter(tree_.top, 0, is_node ? ~(1U << current) : ~0U);
    if (is_node) {
      enter(tree_.nodes[home & kIndexBits], current << FibreTree::kBlockShift, ~0U);
    }
    while (depth_ > 0) {
      const std::uint64_t next = stack_[--depth_];
      const float entry = std::bit_cast<float>(static_cast<std::uint32_t>(next >> 32U));
      if (entry > best_.t_mm) {
        continue;
      }
      const auto child = static_cast<std::uint32_t>(next);
      const std::uint32_t block = (child & ~BoxTree::kLeaf) >> FibreTree::kBlockShift;
      if (block != current) {
        current = block;
        origin_ = all(ray_.origin_mm - tree_.step_mm[block]);
      }
      const std::uint32_t index = child & kIndexBits;
      if ((child & BoxTree::kLeaf) == 0) {
        enter(tree_.nodes[index], block << FibreTree::kBlockShift, ~0U);
      } else if (meets(tree_.leaves[index], block, entry)) {
        break;
      }
    }
    return best_;
  }

 private:
  static constexpr float kLeast = 1e-18f;
  static constexpr std::uint32_t kIndexBits = (1U << FibreTree::kBlockShift) - 1;

  // Puts those of the children in `lanes` that the ray meets on the stack, the nearest on top.
  WEFT_KERNEL void enter(const BoxNode& node, std::uint32_t block_bits, std::uint32_t lanes) {
    const Vector near{load(node.bounds[near_[0]].data()), load(node.bounds[near_[1]].data()),
                      load(node.bounds[near_[2]].data())};
    const Vector far{load(node.bounds[3 - near_[0]].data()), load(node.bounds[5 - near_[1]].data()),
                     load(node.bounds[7 - near_[2]].data())};
    const Floats t_in =
        greatest(greatest((near.x - origin_.x) * inverse_.x, (near.y - origin_.y) * inverse_.y),
                 greatest((near.z - origin_.z) * inverse_.z, all(0)));
    const Floats t_out =
        least(least((far.x - origin_.x) * inverse_.x, (far.y - origin_.y) * inverse_.y),
              least((far.z - origin_.z) * inverse_.z, all(best_.t_mm)));
    const std::uint32_t met = bits(is_at_most(t_in, t_out)) & lanes;
    depth_ += push_nearest_last(stack_.data() + depth_, met, t_in, node.child.data(), block_bits);
  }

  // Tests a leaf; true when the search is over.
  WEFT_KERNEL bool meets(const CapsuleBlock& leaf, std::uint32_t block, float entry) {
    const Entries entries = enter_capsules(leaf, origin_, direction_, all(best_.t_mm));
    std::uint32_t met = bits(entries.met);
    if (kAny && entry == 0) {
      met |= bits(hold_origin(leaf, origin_));
    }
    if (met != 0 && ray_.ignored) {
      std::uint32_t own = met & bits_of_equal(leaf.strand.data(), ray_.ignored->strand);
      for (; own != 0; own &= own - 1) {
        const int lane = std::countr_zero(own);
        if (tree_.copy_of(leaf.id[static_cast<std::size_t>(lane)], block) == *ray_.ignored) {
          met &= ~(1U << lane);
        }
      }
    }
    if (met == 0) {
      return false;
    }
    if constexpr (kAny) {
      best_.order = 0;
      return true;
    }
    alignas(64) std::array<float, kTreeWidth> t;
    store(t.data(), entries.t);
    for (; met != 0; met &= met - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(met));
      const std::uint32_t order = leaf.id[lane] * FibreTree::kBlocks + block;
      if (t[lane] < best_.t_mm || (t[lane] == best_.t_mm && order < best_.order)) {
        best_ = {t[lane], order};
      }
    }
    return false;
  }

  const FibreTree& tree_;
  const TreeRay& ray_;
  Vector origin_;
  const Vector direction_;
  Vector inverse_;
  std::array<std::size_t, 3> near_;  // which of a node's bounds the ray meets first
  TreeHit best_;
  std::size_t depth_ = 0;
  std::array<std::uint64_t, FibreTree::kMaxStack> stack_;
};

}  // namespace
}  // namespace weft::transport
