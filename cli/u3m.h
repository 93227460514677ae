#pragma once

#include <filesystem>

#include "cli/map_set.h"
#include "core/clock.h"

namespace weft::cli {

// Writes NAME.u3m beside a set's pictures: Unified 3D Material 1.1 (vizoogmbh/u3m), its front from
// the maps, its physics from the description and the fibres: thickness from the lowest fibre to the
// highest; composition by the fibres' volumes; construction of a plain weave, a twill or a satin,
// else how many threads it repeats after. Weight stays open, for descriptions have no densities.
// `now` is when it was made. Throws core::Error(kUnavailable) when the file cannot be written.
void write_u3m(const MapSet& set, const std::filesystem::path& folder, core::Clock::Time now);

}  // namespace weft::cli
