#pragma once

#include <cstdint>

#include "fabric/tile.h"

namespace weft::transport {

// Identifies a strand in endless cloth: the strand and the tile its copy belongs to, reduced by the
// strand's period, so that equal values mean the same physical fibre.
struct StrandCopy {
  std::uint32_t strand = 0;
  std::int32_t tile_x = 0;
  std::int32_t tile_y = 0;
  bool operator==(const StrandCopy&) const = default;
};

// The one name of a fibre among those that the strand's period makes equal.
[[nodiscard]] StrandCopy reduced(StrandCopy copy, const fabric::Strand& strand);

}  // namespace weft::transport
