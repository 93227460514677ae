#include "transport/strand_copy.h"

namespace weft::transport {

namespace {

std::int32_t floor_divide(std::int32_t a, std::int32_t b) {
  const std::int32_t quotient = a / b;
  return quotient * b != a && ((a < 0) != (b < 0)) ? quotient - 1 : quotient;
}

}  // namespace

StrandCopy reduced(StrandCopy copy, const fabric::Strand& strand) {
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
