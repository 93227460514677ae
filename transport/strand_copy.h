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
[[nodiscard]] inline StrandCopy reduced(StrandCopy copy, const fabric::Strand& strand) {
  const auto floor_divide = [](std::int32_t a, std::int32_t b) {
    if (b == 1) {
      return a;  // of nearly all cloth
    }
    const std::int32_t quotient = a / b;
    return quotient * b != a && ((a < 0) != (b < 0)) ? quotient - 1 : quotient;
  };
  if (strand.period_x != 0) {
    const std::int32_t n = floor_divide(copy.tile_x, strand.period_x);
    copy.tile_x -= n * strand.period_x;
    copy.tile_y -= n * strand.period_y;
  } else if (strand.period_y != 0) {
    copy.tile_y -= floor_divide(copy.tile_y, strand.period_y) * strand.period_y;
  }
  return copy;
}

}  // namespace weft::transport
