#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fabric/tile.h"
#include "shading/fibre_bcsdf.h"
#include "transport/scene.h"
#include "transport/seen_segments.h"
#include "transport/transfer.h"

namespace weft::bench {

// A fabric as the transfer stage meets it.
struct TransferFabric {
  explicit TransferFabric(const std::string& path);

  std::string name;
  fabric::Tile tile;
  transport::Scene scene;
  std::vector<shading::FibreBcsdf> materials;
  std::vector<transport::CellSegments> cells;
};

// One way of estimating, run again and again on one cell.
struct TransferMethod {
  std::string name;
  transport::TransferSettings settings;
  std::uint64_t paths = 0;  // of a run
};

// What the runs of one method on one cell gave: over entries of the matrix, [3, j1, j0].
struct CellEstimate {
  std::vector<double> mean;
  std::vector<double> squared_error;  // of the mean, from the spread of the runs
  double path_variance = 0;  // paths of a run times the variance of its mean, summed over entries
  double brightness = 0;     // a[0, 0], mean of the channels
};

// Runs `runs` seeds of each method on one cell, in turns, and adds the CPU seconds of each to
// `cpu_seconds`. Both results are one for each method.
[[nodiscard]] std::vector<CellEstimate> estimate_cell(const TransferFabric& fabric,
                                                      std::uint32_t cell, std::uint32_t runs,
                                                      const std::vector<TransferMethod>& methods,
                                                      std::vector<double>& cpu_seconds);

// A mean over cells and its standard error from their spread.
struct Spread {
  double mean = 0;
  double error = 0;
};
[[nodiscard]] Spread spread_of(const std::vector<double>& values);

// Squared differences of two estimates over their squared errors, both summed over entries: 1 in
// the mean where the two have one expectation.
[[nodiscard]] double chi_square(const CellEstimate& a, const CellEstimate& b);

}  // namespace weft::bench
