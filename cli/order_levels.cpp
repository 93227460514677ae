#include "cli/order_levels.h"

#include <algorithm>
#include <numbers>

#include "core/check.h"
#include "core/moments.h"
#include "shading/scattering_orders.h"

namespace weft::cli {

namespace {

using coordinator::kOrderParts;
using coordinator::OrderParts;

constexpr SamplePlan kPlanOfLevels{64, 1024, 0.25, 0x6c6576};  // "lev"

// The integral of a cell's transfer, by channel and by how often light was scattered.
std::array<OrderParts, 3> light_of(const transport::TransferSums& sums, std::size_t materials) {
  const std::size_t width = 1 + shading::order_counts(materials);
  CHECK_EQ(sums.order_numbers.size(),
           shading::order_groups(materials) * shading::kOrderBins * 3 * width);
  std::array<OrderParts, 3> light{};
  for (std::size_t row = 0; row * width < sums.order_numbers.size(); ++row) {
    const std::size_t bin = row / 3 % shading::kOrderBins;
    const std::size_t part = bin == 0 ? 0 : 1 + shading::shape_of_bin(bin);
    light[row % 3][part] +=
        core::from_fixed_point(sums.order_numbers[row * width]) / static_cast<double>(sums.paths);
  }
  return light;
}

}  // namespace

coordinator::OrderLevels traced_levels(const coordinator::CarriedSums& carried,
                                       const coordinator::OrderLevels& levels,
                                       const std::vector<shading::FibreBcsdf>& materials,
                                       const SampleTracer& tracer) {
  constexpr double kPathsForALevel = 16;
  constexpr double kFurthest = 16;
  constexpr double kLightOfAPath =
      4 * std::numbers::pi / static_cast<double>(kPlanOfLevels.paths_per_cell);
  const TracedSample sample = tracer.trace(materials, kPlanOfLevels);
  std::array<OrderParts, 3> traced{};
  std::array<OrderParts, 3> expected{};
  for (std::size_t i = 0; i < sample.cells.size(); ++i) {
    const std::array<OrderParts, 3> light = light_of(sample.sums[i], materials.size());
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t part = 0; part < kOrderParts; ++part) {
        traced[c][part] += light[c][part];
        expected[c][part] += carried.light[sample.cells[i] * 3 + c][part];
      }
    }
  }
  coordinator::OrderLevels result = levels;
  for (std::size_t c = 0; c < 3; ++c) {
    double last = 1;
    for (std::size_t part = 0; part < kOrderParts; ++part) {
      const double least = kPathsForALevel * kLightOfAPath;
      last = std::clamp((traced[c][part] + least * last) / (expected[c][part] + least),
                        1 / kFurthest, kFurthest);
      result.of[c][part] *= last;
    }
  }
  return result;
}

}  // namespace weft::cli
