#pragma once

#include "transport/transfer.h"

namespace weft::transport {

// The sums of the first so many of `paths` after which core::ends_at: paths are added in blocks of
// core::kStoppingBlockPaths, in order, until the error of the cell's coefficients is at or below
// the target or all are used. The same bytes as transfer_sums of as many paths, which `paths` of
// the result says. REQUIRES: paths.first is 0, paths.count from 1 to core::kMostStoppingPaths, and
// the target is above 0.
[[nodiscard]] TransferSums transfer_sums_to_error(const Scene& scene,
                                                  std::span<const shading::FibreBcsdf> materials,
                                                  const CellPaths& paths,
                                                  const TransferSettings& settings,
                                                  double target_standard_error,
                                                  const Checkpoint& checkpoint = {});

}  // namespace weft::transport
