#pragma once

#include "fabric/draft.h"
#include "fabric/yarn_curve.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// Nodes of a centre curve from one crossing to the next.
inline constexpr std::uint32_t kNodesPerCrossing = 8;

// Index into the description's yarns. Throws core::Error(kInvalidArgument) when there is none.
[[nodiscard]] std::uint32_t yarn_index(const v1::FabricDescription& description,
                                       const std::string& name);

// One repeat of a weave, not yet relaxed: evenly spaced threads, first the ends, then the picks,
// that pass over and under each other in smooth steps. A thread's crimp at a crossing is its share
// of the two yarns' half heights; the softer side (thin yarn, long floats) takes the larger share.
// Sections are pressed flat sideways where the sett leaves less than a yarn's width. Throws
// core::Error(kInvalidArgument) when the sett has no room for the yarns even at full flattening.
[[nodiscard]] YarnLayout lay_out_weave(const v1::FabricDescription& description);

}  // namespace weft::fabric
