#pragma once

#include "cli/sample_tracer.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// How far carried-over transfer matrices are from traced ones.
struct CarryError {
  double light = 0;        // relative difference of the light that arrives, in the worst channel
  double light_noise = 0;  // its standard error
  double matrix = 0;       // root mean square of the difference beyond noise, over the traced
  std::size_t cells = 0;   // that were looked at
};

// Compares the matrices of `database` with paths that `tracer` traces in its colours in some of its
// cells, evenly chosen. The same database gives the same numbers.
[[nodiscard]] CarryError check_carried(const storage::FabricDatabase& database,
                                       const std::vector<shading::FibreBcsdf>& materials,
                                       const SampleTracer& tracer);

}  // namespace weft::cli
