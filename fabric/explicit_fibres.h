#pragma once

#include "fabric/build.h"
#include "fabric/tile.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// Fills size, blocks, materials, threads (one for each fibre of the description), strands and
// points from fibres given one by one. The tile is `exemplar.repeats_x/y` times the given size;
// periodic fibres are joined with their copies until they close on it. Positions are kept, but a
// periodic fibre's last point is set to its first one moved by the period. Throws
// core::Error(kInvalidArgument) naming the fibre when it has fewer than two points, a number is not
// finite, or its ends are farther from its period than its radius.
void place_explicit_fibres(const v1::FabricDescription& description, Tile& tile);

[[nodiscard]] TileEstimate estimate_explicit_fibres(const v1::FabricDescription& description);

}  // namespace weft::fabric
