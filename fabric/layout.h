#pragma once

#include "fabric/yarn_curve.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// The yarns of one repeat of a weave or of a pattern of curves, before relaxation. Throws
// core::Error(kInvalidArgument) when the description has neither or they cannot be laid.
[[nodiscard]] YarnLayout lay_out(const v1::FabricDescription& description);

}  // namespace weft::fabric
