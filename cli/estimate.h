#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "fabric/build.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::cli {

// What a fabric will need, from its description alone. The tile's figures are close; cells, disk
// and time are within a factor of about three, and say so when printed.
struct FabricEstimate {
  fabric::TileEstimate tile;
  std::optional<std::uint64_t> cells;  // nothing for structures whose volume is not known yet
  std::uint64_t database_bytes = 0;
  double core_seconds = 0;  // of one core; divide by the cores there are
};

// `description` is canonical. Throws what fabric::estimate_tile throws.
[[nodiscard]] FabricEstimate estimate(const v1::FabricDescription& description);

// Prints the estimate on stdout, as a table or as one JSON value.
void print_estimate(const v1::FabricDescription& description, bool wants_json);

}  // namespace weft::cli
