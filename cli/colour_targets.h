#pragma once

#include <string>
#include <vector>

#include "cli/colour_fit.h"
#include "cli/swatch_colour.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// Yarns that are to show one colour.
struct YarnTarget : ColourTarget {
  std::vector<std::size_t> yarns;  // indices
};

// What "warp=#7a1f2b", ... ask for. Names are those of yarns, "warp" and "weft" (all yarns of ends,
// of picks) or "all". Yarns that share a material are one target. Throws core::Error
// (kInvalidArgument) for what is neither name nor colour, for yarns that are named twice, and for
// yarns of one material that shall have different colours, or of which one shall have none.
[[nodiscard]] std::vector<YarnTarget> colour_targets(const std::vector<std::string>& requests,
                                                     const storage::FabricDatabase& database);

// The mean colours of the targets, of all that is seen of their yarns. Throws core::Error
// (kFailedPrecondition) naming a target of which nothing is seen.
[[nodiscard]] std::vector<glm::dvec3> target_colours(const std::vector<YarnTarget>& targets,
                                                     const std::vector<YarnColour>& yarns);

}  // namespace weft::cli
