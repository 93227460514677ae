#include "cli/traced_difference.h"

#include <algorithm>

#include "core/moments.h"

namespace weft::cli {

namespace {

constexpr SamplePlan kPlanOfDifferences{192, 1536, 0.75, 0x646966};  // "dif"

double light_of(const coordinator::CarriedSums& sums, std::size_t row) {
  double light = 0;
  for (const double part : sums.light[row]) {
    light += part;
  }
  return light;
}

}  // namespace

TracedDifference::TracedDifference(const storage::FabricDatabase& carried,
                                   const coordinator::CarriedSums& sums,
                                   const std::vector<shading::FibreBcsdf>& materials,
                                   const SampleTracer& tracer)
    : yarn_of_cell_(yarns_of_cells(carried, tracer.tile())) {
  const std::size_t rows = carried.yarn_names.size() * 3;
  const std::size_t entries = carried.transfer.size() / sums.light.size();
  std::vector<double> light(rows);
  std::vector<double> noise(rows * entries);  // squared
  differences_.resize(rows * entries);
  const TracedSample sample = tracer.trace(materials, kPlanOfDifferences);
  for (std::size_t i = 0; i < sample.cells.size(); ++i) {
    const std::size_t cell = sample.cells[i];
    const transport::TransferSums& traced = sample.sums[i];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t row = yarn_of_cell_[cell] * 3 + c;
      light[row] += light_of(sums, cell * 3 + c);
      for (std::size_t entry = 0; entry < entries; ++entry) {
        const std::size_t from = c * entries + entry;
        const std::size_t at = cell * 3 * entries + from;
        const core::MeanAndError mean = core::mean_and_error(
            core::from_fixed_point(traced.sum[from]),
            core::from_fixed_point(traced.sum_of_squares[from]), static_cast<double>(traced.paths));
        const double error = carried.transfer_se[at];
        differences_[row * entries + entry] +=
            mean.mean - static_cast<double>(carried.transfer[at]);
        noise[row * entries + entry] += mean.standard_error * mean.standard_error + error * error;
      }
    }
  }
  for (std::size_t i = 0; i < differences_.size(); ++i) {
    double& difference = differences_[i];
    const double square = difference * difference;
    const double of_light = light[i / entries];
    // As far as it is more than noise (the estimate of James and Stein).
    const double sure = square > noise[i] ? 1 - noise[i] / square : 0;
    difference = of_light > 0 ? sure * difference / of_light : 0;
  }
}

void TracedDifference::mend(storage::FabricDatabase& carried,
                            const coordinator::CarriedSums& sums) const {
  const std::size_t entries = carried.transfer.size() / sums.light.size();
  for (std::size_t row = 0; row < sums.light.size(); ++row) {
    const double light = light_of(sums, row);
    const double* difference = &differences_[(yarn_of_cell_[row / 3] * 3 + row % 3) * entries];
    for (std::size_t entry = 0; entry < entries; ++entry) {
      carried.transfer[row * entries + entry] += static_cast<float>(light * difference[entry]);
    }
  }
}

}  // namespace weft::cli
