#pragma once

#include "proto/weft/v1/fabric.pb.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// How far carried-over transfer matrices are from traced ones.
struct CarryError {
  double light = 0;        // relative difference of the light that arrives, in the worst channel
  double light_noise = 0;  // its standard error
  double matrix = 0;       // root mean square of the difference beyond noise, over the traced
  std::size_t cells = 0;   // that were looked at
};

// Traces paths in the colours of `database` in some of its cells, evenly chosen, and compares.
// Reads how the cloth was traced from its provenance. The same database gives the same numbers.
// Throws core::Error(kDataLoss) when the provenance does not say it.
[[nodiscard]] CarryError check_carried(const storage::FabricDatabase& database,
                                       const v1::FabricDescription& description);

}  // namespace weft::cli
