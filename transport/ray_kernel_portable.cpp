#include "transport/ray_lanes_portable.h"
// After the lanes that it is written in.
#include "transport/ray_kernel_text.h"

namespace weft::transport {

TreeHit closest_portable(const FibreTree& tree, const TreeRay& ray) {
  return Search<false>(tree, ray).run();
}

bool occluded_portable(const FibreTree& tree, const TreeRay& ray) {
  return Search<true>(tree, ray).run().order != TreeHit::kNone;
}

}  // namespace weft::transport
