#pragma once

#include <map>
#include <set>
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

// The colours that "warp=#7a1f2b", ... ask for, by yarn. Names are those of yarns, "warp" and
// "weft" (all yarns of ends, of picks) or "all". Throws core::Error(kInvalidArgument) for what is
// neither name nor colour, and for yarns that are named twice.
[[nodiscard]] std::map<std::size_t, glm::dvec3> requested_colours(
    const std::vector<std::string>& requests, const storage::FabricDatabase& database);

// The materials that each yarn's fibres are of.
[[nodiscard]] std::vector<std::set<std::size_t>> materials_of_yarns(
    const storage::FabricDatabase& database);

// What is asked for. Yarns that share a material are one target. Throws as requested_colours.
// REQUIRES: yarns of one material are asked for one colour (split_materials.h).
[[nodiscard]] std::vector<YarnTarget> colour_targets(const std::vector<std::string>& requests,
                                                     const storage::FabricDatabase& database);

// The mean colours of the targets, of all that is seen of their yarns. Throws core::Error
// (kFailedPrecondition) naming a target of which nothing is seen.
[[nodiscard]] std::vector<glm::dvec3> target_colours(const std::vector<YarnTarget>& targets,
                                                     const std::vector<YarnColour>& yarns);

}  // namespace weft::cli
