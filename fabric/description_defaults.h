#pragma once

#include <cstdint>

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

// What a tile of preview quality is thinned to: at this many segments a whole precomputation takes
// a minute or two on two cores.
inline constexpr std::uint64_t kPreviewSegments = 20000;

// Bounds the fields that set the cost by the description's quality, as fabric.proto states at
// Quality. Fields that the description sets are bounded, too. Doing it twice changes nothing.
// REQUIRES: check_fields finds no mistake.
void apply_quality(v1::FabricDescription& description);

// Throws core::Error(kResourceExhausted) when the tile would need more than kTileLimitBytes
// (fabric/build.h), and what estimate_tile throws. REQUIRES: check_fields finds no mistake.
void check_size(const v1::FabricDescription& description);

}  // namespace weft::fabric
