#include "cli/carry_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/moments.h"
#include "core/random.h"
#include "proto/weft/v1/task.pb.h"
#include "render/fabric.h"
#include "shading/fibre_bcsdf.h"
#include "transport/scene.h"
#include "transport/seen_segments.h"
#include "transport/transfer.h"

namespace weft::cli {

namespace {

constexpr std::size_t kMostCells = 48;
constexpr std::uint64_t kPathsPerCell = 2048;
// core::derive_seed of the description's seed: none of the paths that the base was made from.
constexpr std::uint32_t kPurposeOfCheck = 0x636865;  // "che"

// How the grid's stage weighed segments. The text came with the file.
v1::GridSpec grid_spec_of(const std::string& stages_json) {
  constexpr int kDeepest = 16;
  constexpr std::uint32_t kMostRays = 1024;
  using Json = nlohmann::json;
  const auto is_shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; };
  const Json json = Json::parse(stages_json, is_shallow, false);
  const bool has_stages =
      json.is_object() && json.contains("stages") && json.at("stages").is_array();
  for (const Json& stage : has_stages ? json.at("stages") : Json::array()) {
    if (!stage.is_object() || !stage.contains("name") || stage.at("name") != "grid" ||
        !stage.contains("spec")) {
      continue;
    }
    v1::TaskSpec spec;
    const bool is_spec =
        google::protobuf::util::JsonStringToMessage(stage.at("spec").dump(), &spec).ok();
    if (is_spec && spec.grid().seen_rays_per_segment() >= 1 &&
        spec.grid().seen_rays_per_segment() <= kMostRays) {
      return spec.grid();
    }
  }
  throw core::Error(core::Code::kDataLoss,
                    "dataset /provenance/stages does not say how the grid was made; make the "
                    "fabric again");
}

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
                         const v1::FabricDescription& description) {
  const v1::GridSpec grid = grid_spec_of(database.stages_json);
  const fabric::Tile tile = render::tile_of(database);
  const transport::Scene scene(tile);
  const std::size_t cells = database.cell_paths.size();
  const std::vector<transport::CellSegments> segments = transport::segments_by_cell(
      database.cell_of_segment, cells,
      transport::seen_segments(scene, grid.seen_rays_per_segment(), grid.seed()));
  const std::vector<shading::FibreBcsdf> materials(database.materials.begin(),
                                                   database.materials.end());
  transport::TransferSettings settings;
  settings.sh_order = database.sh_order;
  settings.seed = core::derive_seed(description.seed(), kPurposeOfCheck);
  settings.max_path_length = description.precompute().max_path_length();
  const std::size_t count = std::min(kMostCells, cells);
  Comparison comparison;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t cell = (2 * i + 1) * cells / (2 * count);
    const transport::CellPaths paths{static_cast<std::uint32_t>(cell), &segments[cell], 0,
                                     kPathsPerCell};
    compare_cell(database, cell, transport::transfer_sums(scene, materials, paths, settings),
                 comparison);
  }
  return error_of(comparison, count);
}

}  // namespace weft::cli
