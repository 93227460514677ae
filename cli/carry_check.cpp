#include "cli/carry_check.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/moments.h"

namespace weft::cli {

namespace {

constexpr SamplePlan kPlanOfCheck{48, 2048, 0.5, 0x636865};  // "che"

// Sums over the cells, by channel and over all.
struct Comparison {
  std::array<double, 3> carried{};
  std::array<double, 3> traced{};
  std::array<double, 3> noise_squared{};  // of the light
  double difference_squared = 0;          // of matrices
  double traced_squared = 0;
};

void compare_cell(const storage::FabricDatabase& db, std::size_t cell,
                  const transport::TransferSums& sums, Comparison& comparison) {
  const std::size_t entries = sums.sum.size() / 3;
  for (std::size_t i = 0; i < sums.sum.size(); ++i) {
    const core::MeanAndError traced = core::mean_and_error(
        core::from_fixed_point(sums.sum[i]), core::from_fixed_point(sums.sum_of_squares[i]),
        static_cast<double>(sums.paths));
    const double carried = db.transfer[cell * 3 * entries + i];
    const double error = db.transfer_se[cell * 3 * entries + i];
    const double noise_squared = error * error + traced.standard_error * traced.standard_error;
    const double difference = carried - traced.mean;
    comparison.difference_squared += difference * difference - noise_squared;
    comparison.traced_squared += traced.mean * traced.mean;
    if (i % entries == 0) {
      const std::size_t channel = i / entries;
      comparison.carried[channel] += carried;
      comparison.traced[channel] += traced.mean;
      comparison.noise_squared[channel] += noise_squared;
    }
  }
}

CarryError error_of(const Comparison& comparison, std::size_t cells) {
  CarryError error;
  error.cells = cells;
  for (std::size_t c = 0; c < 3; ++c) {
    const double traced = comparison.traced[c];
    if (traced > 0) {
      const double light = comparison.carried[c] / traced - 1;
      if (std::abs(light) >= std::abs(error.light)) {
        error.light = light;
        error.light_noise = std::sqrt(comparison.noise_squared[c]) / traced;
      }
    }
  }
  if (comparison.traced_squared > 0) {
    error.matrix =
        std::sqrt(std::max(0.0, comparison.difference_squared) / comparison.traced_squared);
  }
  return error;
}

}  // namespace

CarryError check_carried(const storage::FabricDatabase& database,
                         const std::vector<shading::FibreBcsdf>& materials,
                         const SampleTracer& tracer) {
  const TracedSample traced = tracer.trace(materials, kPlanOfCheck);
  Comparison comparison;
  for (std::size_t i = 0; i < traced.cells.size(); ++i) {
    compare_cell(database, traced.cells[i], traced.sums[i], comparison);
  }
  return error_of(comparison, traced.cells.size());
}

}  // namespace weft::cli
