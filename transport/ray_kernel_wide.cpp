#include "transport/ray_lanes_wide.h"
// After the lanes that it is written in.
#include "transport/ray_kernel_text.h"

namespace weft::transport {

WEFT_WIDE TreeHit closest_wide(const FibreTree& tree, const TreeRay& ray) {
  return Search<false>(tree, ray).run();
}

WEFT_WIDE bool occluded_wide(const FibreTree& tree, const TreeRay& ray) {
  return Search<true>(tree, ray).run().order != TreeHit::kNone;
}

}  // namespace weft::transport
