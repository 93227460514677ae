#include "transport/stopping.h"

#include <algorithm>

#include "core/check.h"
#include "core/stopping.h"
#include "transport/sh_chunk.h"

namespace weft::transport {

namespace {

// Blocks are whole chunks, and fit into what core::ends_at leaves free of the range of 2^31.
static_assert(core::kStoppingBlockPaths % kTransferChunkPaths == 0);
static_assert(core::kStoppingBlockPaths * ShChunk::kLargestSum < kTransferChunkPaths * 0x1p28);

}  // namespace

TransferSums transfer_sums_to_error(const Scene& scene,
                                    std::span<const shading::FibreBcsdf> materials,
                                    const CellPaths& paths, const TransferSettings& settings,
                                    double target_standard_error, const Checkpoint& checkpoint) {
  CHECK_EQ(paths.first, 0U);
  CHECK_GT(paths.count, 0U);
  CHECK_LE(paths.count, core::kMostStoppingPaths);
  CHECK(target_standard_error > 0);
  const core::StoppingRule rule{target_standard_error, paths.count};
  CellPaths block = paths;
  block.count = std::min(core::kStoppingBlockPaths, paths.count);
  TransferSums sums = transfer_sums(scene, materials, block, settings, checkpoint);
  while (!core::ends_at(rule, {sums.sum, sums.sum_of_squares, sums.paths})) {
    block.first = sums.paths;
    block.count = std::min(core::kStoppingBlockPaths, paths.count - sums.paths);
    add_sums(transfer_sums(scene, materials, block, settings, checkpoint), sums);
  }
  return sums;
}

}  // namespace weft::transport
