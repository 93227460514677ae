#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/stopping.h"
#include "proto/arrays.h"
#include "shading/fibre_bcsdf.h"
#include "shading/scattering_orders.h"
#include "transport/stopping.h"
#include "transport/transfer.h"
#include "worker/bakers.h"
#include "worker/materials.h"
#include "worker/tile_scene.h"

namespace weft::worker {

namespace {

class TransferBaker : public Baker {
 public:
  explicit TransferBaker(const BakerContext& context)
      : spec_(context.spec.transfer()), shard_count_(context.shard_count) {
    require_inputs(context, "transfer", 2);
    require(spec_.sh_order() <= 5, "transfer", "sh_order must be between 0 and 5");
    require(spec_.paths_per_cell() > 0 && spec_.paths_per_shard() > 0, "transfer",
            "paths_per_cell and paths_per_shard must be positive");
    require(spec_.target_standard_error() >= 0, "transfer",
            "target_standard_error must be positive, or 0 for none");
    require(!has_target() || (spec_.paths_per_cell() == spec_.paths_per_shard() &&
                              spec_.paths_per_cell() <= core::kMostStoppingPaths),
            "transfer",
            "a target standard error needs one shard for each cell, of at most 2^20 paths");
    require(spec_.max_path_length() > 0, "transfer", "max_path_length must be positive");
    require(spec_.estimator() == v1::TRANSFER_ESTIMATOR_EXIT ||
                spec_.estimator() == v1::TRANSFER_ESTIMATOR_LIGHT,
            "transfer", "the estimator must be EXIT or LIGHT");
    input_ = tile_scene(context.inputs[0]);
    materials_ = bcsdfs_of(spec_.materials(), input_->tile, "transfer");
    read_cells(context.inputs[1]);
    blocks_per_cell_ = (std::uint64_t{spec_.paths_per_cell()} + spec_.paths_per_shard() - 1) /
                       spec_.paths_per_shard();
    require(shard_count_ == cells_.size() * blocks_per_cell_, "transfer",
            "the number of shards is not cells times blocks per cell");
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    const std::uint64_t cell = shard / blocks_per_cell_;
    transport::CellPaths paths;
    paths.cell = static_cast<std::uint32_t>(cell);
    paths.segments = &cells_[cell];
    paths.first = shard % blocks_per_cell_ * spec_.paths_per_shard();
    paths.count =
        std::min<std::uint64_t>(spec_.paths_per_shard(), spec_.paths_per_cell() - paths.first);
    transport::TransferSettings settings;
    settings.sh_order = spec_.sh_order();
    settings.estimator = spec_.estimator() == v1::TRANSFER_ESTIMATOR_LIGHT
                             ? transport::Estimator::kLight
                             : transport::Estimator::kExit;
    settings.seed = spec_.seed();
    settings.max_path_length = spec_.max_path_length();
    const transport::Checkpoint checkpoint = stop_point(should_stop);
    const transport::TransferSums sums =
        has_target()
            ? transport::transfer_sums_to_error(input_->scene, materials_, paths, settings,
                                                spec_.target_standard_error(), checkpoint)
            : transport::transfer_sums(input_->scene, materials_, paths, settings, checkpoint);

    const std::uint64_t j = std::uint64_t{spec_.sh_order() + 1} * (spec_.sh_order() + 1);
    const std::array<std::uint64_t, 1> count{sums.paths};
    v1::Arrays arrays;
    v1::add_array<std::uint64_t>(arrays, "paths", {1}, count);
    v1::add_array<std::int64_t>(arrays, "sum", {3, j, j}, sums.sum);
    v1::add_array<std::int64_t>(arrays, "sum_of_squares", {3, j, j}, sums.sum_of_squares);
    if (!sums.order_numbers.empty()) {
      const std::uint64_t materials = materials_.size();
      const std::uint64_t low = shading::shape_coefficients(spec_.sh_order());
      v1::add_array<std::int64_t>(arrays, "order_numbers",
                                  {shading::order_groups(materials), shading::kOrderBins, 3,
                                   1 + shading::order_counts(materials)},
                                  sums.order_numbers);
      v1::add_array<std::int64_t>(arrays, "order_shapes", {shading::kOrderShapes, low, low},
                                  sums.order_shapes);
    }
    return v1::serialize(arrays);
  }

 private:
  [[nodiscard]] bool has_target() const { return spec_.target_standard_error() > 0; }

  void read_cells(const std::string& grid) {
    const v1::Arrays arrays = v1::parse_arrays(grid);
    const auto cell_of_segment = v1::array_of<std::uint32_t>(arrays, "cell_of_segment");
    std::vector<std::uint64_t> shape;
    static_cast<void>(v1::array_of<std::uint32_t>(arrays, "cell_coordinates", &shape));
    if (shape.empty() || cell_of_segment.size() != input_->tile.segment_count()) {
      throw core::Error(core::Code::kDataLoss, "the grid was not made for this tile");
    }
    cells_ = transport::segments_by_cell(cell_of_segment, shape[0],
                                         v1::array_of<std::uint32_t>(arrays, "seen"));
  }

  v1::TransferSpec spec_;
  std::uint64_t shard_count_;
  std::uint64_t blocks_per_cell_ = 1;
  std::shared_ptr<const TileScene> input_;
  std::vector<shading::FibreBcsdf> materials_;
  std::vector<transport::CellSegments> cells_;
};

}  // namespace

std::unique_ptr<Baker> make_transfer_baker(const BakerContext& context) {
  return std::make_unique<TransferBaker>(context);
}

}  // namespace weft::worker
