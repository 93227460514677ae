#pragma once

#include <cstdint>

#include "core/parallel.h"
#include "fabric/tile.h"

namespace weft::fabric {

// What is promised of cloth whose fibres have room (at most about half of the space that their
// yarns take): at most this share of the segments' midpoints lies inside another fibre. Visibility
// counts such a midpoint as blocked from all sides.
inline constexpr double kBuriedTolerance = 0.05;

struct UntangleReport {
  std::uint32_t iterations = 0;
  double buried_share = 0;   // of the midpoints, at the end
  double mean_moved_mm = 0;  // of the points, from where they were laid
};

// Moves fibres apart until they hardly overlap: where two come closer than their radii, both give
// way by half (position-based, all contacts at once, so no order is preferred). Displacements are
// smoothed along every fibre, which keeps it as smooth as it was laid, and pulled back to the laid
// path, which keeps twist and crimp. Periodic strands keep their period exactly, tips are free.
// The same tile gives the same bytes, on any number of threads.
UntangleReport untangle(Tile& tile, unsigned most_threads = core::kAllCores);

// Share of the segments whose midpoint lies inside another fibre; a fibre's lateral copies are
// other fibres.
[[nodiscard]] double buried_share(const Tile& tile, unsigned most_threads = core::kAllCores);

}  // namespace weft::fabric
