#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "fabric/tile.h"
#include "proto/weft/v1/fabric.pb.h"
#include "shading/fibre_bcsdf.h"
#include "storage/fabric_database.h"
#include "transport/scene.h"
#include "transport/seen_segments.h"
#include "transport/transfer.h"

namespace weft::cli {

// Paths of some of a fabric's cells.
struct TracedSample {
  std::vector<std::size_t> cells;
  std::vector<transport::TransferSums> sums;  // of each of them
};

// Which cells: `count` of them or all there are, evenly chosen, and not those of another share of
// the way from one to the next (0 to 1) where there are enough. What for: paths of different
// purposes are different ones, and none of those that the fabric was made from.
struct SamplePlan {
  std::size_t count = 0;
  std::uint64_t paths_per_cell = 0;
  double share = 0.5;
  std::uint32_t purpose = 0;
};

// Traces a few paths in a fabric, in any colours. Reads how it was traced from its provenance.
class SampleTracer {
 public:
  // Throws core::Error(kDataLoss) when the provenance does not say it.
  SampleTracer(const storage::FabricDatabase& database, const v1::FabricDescription& description,
               unsigned threads);

  // The same arguments give the same numbers, on any number of threads.
  [[nodiscard]] TracedSample trace(const std::vector<shading::FibreBcsdf>& materials,
                                   const SamplePlan& plan) const;
  [[nodiscard]] const fabric::Tile& tile() const { return *tile_; }

 private:
  std::unique_ptr<const fabric::Tile> tile_;
  std::unique_ptr<const transport::Scene> scene_;  // refers to the tile
  std::vector<transport::CellSegments> segments_;
  transport::TransferSettings settings_;
  unsigned threads_;
};

// The yarn that most of a cell's segments are of, the first of equals: [cells].
[[nodiscard]] std::vector<std::size_t> yarns_of_cells(const storage::FabricDatabase& database,
                                                      const fabric::Tile& tile);

}  // namespace weft::cli
