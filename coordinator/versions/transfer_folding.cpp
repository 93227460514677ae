#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/versions/result_folding.h"
#include "coordinator/versions/shard_result.h"
#include "core/error.h"
#include "core/half.h"
#include "core/moments.h"
#include "core/parallel.h"
#include "core/stopping.h"
#include "shading/scattering_orders.h"

// What the transfer stage's results come to: fold_transfer of result_folding.h.

namespace weft::coordinator {

namespace {

// Sums over all shards of a cell: no number of paths overflows it.
__extension__ typedef __int128 WideSum;

// Sums over the shards of one cell.
struct CellSums {
  std::uint64_t paths = 0;
  std::vector<WideSum> sum;
  std::vector<WideSum> sum_of_squares;
  std::vector<WideSum> order_numbers;
  std::vector<WideSum> order_shapes;
};

void add_to(std::vector<WideSum>& sums, const std::vector<std::int64_t>& more) {
  sums.resize(more.size(), 0);
  for (std::size_t i = 0; i < more.size(); ++i) {
    sums[i] += more[i];
  }
}

// Whether the results of this stage tell orders of scattering apart.
bool has_orders(const v1::TransferSpec& spec) {
  const auto materials = static_cast<std::size_t>(spec.materials_size());
  return spec.estimator() == v1::TRANSFER_ESTIMATOR_EXIT && materials >= 1 &&
         materials <= shading::kMostCountedMaterials;
}

void add_orders(const ShardResult& result, const v1::TransferSpec& spec, CellSums& cell) {
  const auto materials = static_cast<std::size_t>(spec.materials_size());
  const std::uint64_t low = shading::shape_coefficients(spec.sh_order());
  const auto numbers = result.array<std::int64_t>(
      "order_numbers", {shading::order_groups(materials), shading::kOrderBins, 3,
                        1 + shading::order_counts(materials)});
  result.require(std::all_of(numbers.begin(), numbers.end(), [](auto n) { return n >= 0; }),
                 "light or a count of its scatterings is negative");
  add_to(cell.order_numbers, numbers);
  add_to(cell.order_shapes,
         result.array<std::int64_t>("order_shapes", {shading::kOrderShapes, low, low}));
}

std::uint16_t half_of(double value) {
  constexpr double kLargestHalf = 65504;
  return core::half_from_float(static_cast<float>(std::clamp(value, -kLargestHalf, kLargestHalf)));
}

double mean_of(WideSum sum, std::uint64_t paths) {
  return paths == 0
             ? 0
             : static_cast<double>(sum) / core::kFixedPointScale / static_cast<double>(paths);
}

// Light, mean counts of it and shapes of one cell go to their places.
void fold_orders(const CellSums& cell, std::uint64_t index, std::size_t materials,
                 storage::Recolouring& recolouring) {
  const std::size_t counts = shading::order_counts(materials);
  const std::size_t lights = cell.order_numbers.size() / (1 + counts);
  std::uint16_t* light_to = recolouring.order_light.data() + index * lights;
  std::uint16_t* count_to = recolouring.order_counts.data() + index * lights * counts;
  for (auto number = cell.order_numbers.begin(); number != cell.order_numbers.end();) {
    const WideSum light = *number++;
    *light_to++ = half_of(mean_of(light, cell.paths));
    for (std::size_t k = 0; k < counts; ++k) {
      const WideSum counted = *number++;
      *count_to++ =
          half_of(light > 0 ? static_cast<double>(counted) / static_cast<double>(light) : 0);
    }
  }
  std::uint16_t* shape_to = recolouring.order_shapes.data() + index * cell.order_shapes.size();
  for (const WideSum sum : cell.order_shapes) {
    *shape_to++ = half_of(mean_of(sum, cell.paths));
  }
}

void add_shard(const FinishedStage& transfer, std::uint64_t shard, const ReadBlob& read_blob,
               CellSums& cell) {
  const v1::TransferSpec& spec = transfer.stage.spec.transfer();
  const std::uint64_t n = std::uint64_t{spec.sh_order() + 1} * (spec.sh_order() + 1);
  const ShardResult result(transfer, shard, read_blob);
  const auto paths = result.array<std::uint64_t>("paths", {1});
  const auto sum = result.array<std::int64_t>("sum", {3, n, n});
  const auto sum_of_squares = result.array<std::int64_t>("sum_of_squares", {3, n, n});
  result.require(paths[0] <= spec.paths_per_shard(), "it has more paths than a shard holds");
  result.require(
      std::all_of(sum_of_squares.begin(), sum_of_squares.end(), [](auto s) { return s >= 0; }),
      "a sum of squares is negative");
  if (spec.target_standard_error() > 0) {
    result.require(core::ends_at({spec.target_standard_error(), spec.paths_per_cell()},
                                 {sum, sum_of_squares, paths[0]}),
                   "its paths end where the target standard error lets none end");
  }
  cell.paths += paths[0];
  add_to(cell.sum, sum);
  add_to(cell.sum_of_squares, sum_of_squares);
  if (has_orders(spec)) {
    add_orders(result, spec, cell);
  }
}

// Makes room for what all cells hold.
void size_tables(const v1::TransferSpec& spec, std::uint64_t cells,
                 storage::FabricDatabase& database, storage::Recolouring& recolouring) {
  const std::uint64_t n = std::uint64_t{spec.sh_order() + 1} * (spec.sh_order() + 1);
  database.sh_order = spec.sh_order();
  database.cell_paths.resize(cells);
  database.transfer.resize(cells * 3 * n * n);
  database.transfer_se.resize(cells * 3 * n * n);
  if (has_orders(spec)) {
    const auto materials = static_cast<std::size_t>(spec.materials_size());
    const std::uint64_t low = shading::shape_coefficients(spec.sh_order());
    const std::uint64_t lights = shading::order_groups(materials) * shading::kOrderBins * 3;
    recolouring.order_light.resize(cells * lights);
    recolouring.order_counts.resize(cells * lights * shading::order_counts(materials));
    recolouring.order_shapes.resize(cells * shading::kOrderShapes * low * low);
  }
}

// One cell of the tables, from its shards.
void fold_cell(const FinishedStage& transfer, std::uint64_t cell, const ReadBlob& read_blob,
               storage::FabricDatabase& database, storage::Recolouring& recolouring) {
  const v1::TransferSpec& spec = transfer.stage.spec.transfer();
  const std::uint64_t blocks = transfer.shards.size() / database.cell_paths.size();
  CellSums sums;
  for (std::uint64_t block = 0; block < blocks; ++block) {
    add_shard(transfer, cell * blocks + block, read_blob, sums);
  }
  if (spec.target_standard_error() == 0 && sums.paths != spec.paths_per_cell()) {
    throw core::Error(core::Code::kDataLoss,
                      "stage transfer, shards " + std::to_string(cell * blocks) + " to " +
                          std::to_string(cell * blocks + blocks - 1) + ": they have " +
                          std::to_string(sums.paths) + " paths together where " +
                          std::to_string(spec.paths_per_cell()) +
                          " were planned; delete them and compute them again");
  }
  database.cell_paths[cell] = sums.paths;
  if (has_orders(spec)) {
    fold_orders(sums, cell, static_cast<std::size_t>(spec.materials_size()), recolouring);
  }
  const std::size_t first = cell * sums.sum.size();
  for (std::size_t i = 0; i < sums.sum.size(); ++i) {
    const core::MeanAndError moments =
        core::mean_and_error(static_cast<double>(sums.sum[i]) / core::kFixedPointScale,
                             static_cast<double>(sums.sum_of_squares[i]) / core::kFixedPointScale,
                             static_cast<double>(sums.paths));
    database.transfer[first + i] = static_cast<float>(moments.mean);
    database.transfer_se[first + i] = static_cast<float>(moments.standard_error);
  }
}

}  // namespace

void fold_transfer(const FinishedStage& transfer, const ReadBlob& read_blob,
                   storage::FabricDatabase& database, storage::Recolouring& recolouring) {
  const std::uint64_t cells = database.cell_coordinates.size() / 3;
  size_tables(transfer.stage.spec.transfer(), cells, database, recolouring);
  core::in_parallel(cells, [&](std::size_t cell) {
    fold_cell(transfer, cell, read_blob, database, recolouring);
  });
}

}  // namespace weft::coordinator
