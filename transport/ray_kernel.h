#pragma once

#include <cstdint>
#include <optional>

#include <glm/vec3.hpp>

#include "transport/fibre_tree.h"
#include "transport/strand_copy.h"
#include "transport/wide.h"

namespace weft::transport {

// One leg of a ray: from `origin_mm` in the central block along unit `direction`.
struct TreeRay {
  glm::vec3 origin_mm;
  glm::vec3 direction;
  float t_max_mm;
  std::optional<StrandCopy> ignored;  // relative to the central block, reduced
};

struct TreeHit {
  static constexpr std::uint32_t kNone = 0xffffffffU;

  float t_mm;
  std::uint32_t order = kNone;  // id * kBlocks + block: of equally near ones the least is met
};

// The entry into a capsule that is nearest among those at 0 to t_max_mm; none: order is kNone. The
// result is a property of the capsules: the hierarchy's shape and the order in which it is searched
// do not enter, and both paths give the same bits. The wide path needs wide_is_available().
// Denormals are taken as the caller's floating-point mode says.
[[nodiscard]] TreeHit closest_portable(const FibreTree& tree, const TreeRay& ray);
WEFT_WIDE [[nodiscard]] TreeHit closest_wide(const FibreTree& tree, const TreeRay& ray);

// Whether a capsule has its entry at 0 to t_max_mm or holds the ray's origin.
[[nodiscard]] bool occluded_portable(const FibreTree& tree, const TreeRay& ray);
WEFT_WIDE [[nodiscard]] bool occluded_wide(const FibreTree& tree, const TreeRay& ray);

}  // namespace weft::transport
