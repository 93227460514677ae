#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "proto/arrays.h"
#include "transport/cell_grid.h"
#include "transport/seen_segments.h"
#include "worker/bakers.h"
#include "worker/tile_scene.h"

namespace weft::worker {

namespace {

class GridBaker : public Baker {
 public:
  explicit GridBaker(const BakerContext& context)
      : spec_(context.spec.grid()), shard_count_(context.shard_count) {
    require_inputs(context, "grid", 1);
    require(spec_.rays() > 0, "grid", "rays must be positive");
    require(spec_.seen_rays_per_segment() > 0 && spec_.seen_rays_per_segment() <= 1024, "grid",
            "seen_rays_per_segment must be between 1 and 1024");
    require(spec_.cell_length_mfp() > 0 && std::isfinite(spec_.cell_length_mfp()), "grid",
            "cell_length_mfp must be positive");
    input_ = tile_scene(context.inputs[0]);
  }

  std::string bake(std::uint64_t shard, const std::string& /*shard_input*/,
                   const std::function<bool()>& should_stop) const override {
    require_shard(shard, shard_count_);
    const double path_mm = transport::mean_free_path(input_->scene, spec_.rays(), spec_.seed(),
                                                     stop_point(should_stop));
    const transport::CellGrid grid =
        transport::make_cell_grid(input_->tile, path_mm * spec_.cell_length_mfp());
    const std::vector<std::uint32_t> seen = transport::seen_segments(
        input_->scene, spec_.seen_rays_per_segment(), spec_.seed(), stop_point(should_stop));
    std::vector<std::uint32_t> coordinates;
    coordinates.reserve(3 * grid.cell_coordinates.size());
    for (const glm::uvec3& cell : grid.cell_coordinates) {
      coordinates.insert(coordinates.end(), {cell.x, cell.y, cell.z});
    }
    const std::array<float, 1> path{static_cast<float>(path_mm)};
    const std::array<std::uint32_t, 3> per_axis{grid.cells_per_axis.x, grid.cells_per_axis.y,
                                                grid.cells_per_axis.z};
    v1::Arrays arrays;
    v1::add_array<float>(arrays, "mean_free_path_mm", {1}, path);
    v1::add_array<std::uint32_t>(arrays, "cells_per_axis", {3}, per_axis);
    v1::add_array<std::uint32_t>(arrays, "cell_of_segment", {grid.cell_of_segment.size()},
                                 grid.cell_of_segment);
    v1::add_array<std::uint32_t>(arrays, "seen", {seen.size()}, seen);
    v1::add_array<std::uint32_t>(arrays, "cell_coordinates", {grid.cell_coordinates.size(), 3},
                                 coordinates);
    return v1::serialize(arrays);
  }

 private:
  v1::GridSpec spec_;
  std::uint64_t shard_count_;
  std::shared_ptr<const TileScene> input_;
};

}  // namespace

std::unique_ptr<Baker> make_grid_baker(const BakerContext& context) {
  return std::make_unique<GridBaker>(context);
}

}  // namespace weft::worker
