#pragma once

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// What a yarn without a preset takes for the fields that it leaves out.
inline constexpr std::uint32_t kDefaultPlies = 1;
inline constexpr std::uint32_t kDefaultFibresPerPly = 40;
inline constexpr double kDefaultPacking = 0.5;       // fibre area over its ply's section
inline constexpr double kDefaultFibreAngleDeg = 15;  // of surface fibres to the ply's axis
inline constexpr double kDefaultPlyAngleDeg = 20;    // of the plies to the yarn's axis
inline constexpr double kDefaultSegmentLengthRadii = 8;

// Expands every default of a description whose files are inlined and whose presets are filled in.
// A field that is set stays as it is, so expanding twice changes nothing. Lengths that make no
// sense give defaults that make no sense: check afterwards.
void expand_defaults(v1::FabricDescription& description);

// Bounds the fields that set the cost by the description's quality. Preview lowers what is above
// its bounds, best raises what is below; paper changes nothing. Doing it twice changes nothing.
// REQUIRES: defaults are expanded.
void apply_quality(v1::FabricDescription& description);

}  // namespace weft::fabric
