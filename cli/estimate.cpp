#include "cli/estimate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/print_json.h"
#include "cli/progress.h"

namespace weft::cli {

namespace {

// Between what a core of docs/performance.md reached: directions of painted visibility (8e7 in
// dense weaves, 2e7 in a fleece), signed distances with their fit, paths of the transfer matrix
// (5e4 with many scatterings to 2.5e5).
constexpr double kVisibilityPixelsPerSecond = 6e7;
constexpr double kCoefficientsSecondsPerSegment = 2.5e-4;
constexpr double kPathsPerSecond = 1.2e5;
// Share of the room that straight yarns on top of each other would take: those of cloth are pressed
// (0.7 to 1 measured).
constexpr double kPressed = 0.85;

const v1::Yarn* find_yarn(const v1::FabricDescription& description, const std::string& name) {
  for (const v1::Yarn& yarn : description.yarns()) {
    if (yarn.name() == name) {
      return &yarn;
    }
  }
  return nullptr;
}

// What a yarn adds to the cloth's thickness: its ellipse, spread in its room as the layout does,
// and the reach of its hairs as far as these are many.
double thickness_mm(const v1::Yarn& yarn, double threads_per_cm) {
  constexpr double kSpread = 0.8;
  const double radius = yarn.yarn_radius_mm();
  const double spread = std::min(radius / (1 - yarn.flattening()), kSpread * 5 / threads_per_cm);
  const double hairiness = yarn.hairs().per_mm() * yarn.hairs().length_mm() /
                           (static_cast<double>(yarn.plies()) * yarn.fibres_per_ply());
  return 2 * radius * radius / std::max(radius, spread) +
         yarn.hairs().reach_mm() * std::min(1.0, hairiness);
}

// Cells of a weave: volume over the cube of the cell's length, with 1/l = pi r L_v / 2 for the mean
// free path of cylinders of radius r and length L_v per volume, spread at random.
std::optional<std::uint64_t> estimate_cells(const v1::FabricDescription& description,
                                            const fabric::TileEstimate& tile) {
  const v1::Weave& weave = description.weave();
  const v1::Yarn* warp = find_yarn(description, weave.warp_yarn());
  const v1::Yarn* weft = find_yarn(description, weave.weft_yarn());
  if (!description.has_weave() || warp == nullptr || weft == nullptr) {
    return std::nullopt;
  }
  const double volume_mm3 =
      kPressed * 10 * tile.ends / weave.ends_per_cm() * 10 * tile.picks / weave.picks_per_cm() *
      (thickness_mm(*warp, weave.ends_per_cm()) + thickness_mm(*weft, weave.picks_per_cm()));
  const double radius_mm = (warp->fibre_radius_mm() + weft->fibre_radius_mm()) /
                           (2 * std::sqrt(description.exemplar().fibre_share()));
  const double length_mm = static_cast<double>(tile.segments) *
                           description.exemplar().segment_length_radii() * radius_mm;
  const double mean_free_path_mm = 2 * volume_mm3 / (std::numbers::pi * radius_mm * length_mm);
  const double cell_mm = description.precompute().cell_length_mfp() * mean_free_path_mm;
  const double cells = volume_mm3 / (cell_mm * cell_mm * cell_mm);
  if (!std::isfinite(cells)) {
    return std::nullopt;
  }
  return static_cast<std::uint64_t>(std::clamp(cells, 1.0, 1e12));
}

}  // namespace

FabricEstimate estimate(const v1::FabricDescription& description) {
  FabricEstimate result;
  result.tile = fabric::estimate_tile(description);
  result.cells = estimate_cells(description, result.tile);
  const v1::Precompute& precompute = description.precompute();
  const std::uint64_t pixels =
      std::uint64_t{precompute.visibility_resolution()} * precompute.visibility_resolution();
  const std::uint64_t order = precompute.sh_order() + 1;
  // Per segment: halves of both representations, a point, the cell, rotation and open share. Per
  // cell: mean and standard error in half precision. The basis in single precision.
  const std::uint64_t bytes_per_segment =
      2 * (std::uint64_t{precompute.pca_components()} + precompute.sg_count()) + 12 + 4 + 4;
  result.database_bytes = result.tile.segments * bytes_per_segment +
                          result.cells.value_or(0) * 3 * order * order * order * order * 4 +
                          (precompute.pca_components() + 1) * pixels * 4;
  result.core_seconds =
      static_cast<double>(result.tile.segments) *
          (static_cast<double>(pixels) / kVisibilityPixelsPerSecond +
           kCoefficientsSecondsPerSegment) +
      static_cast<double>(result.cells.value_or(0)) * precompute.paths_per_cell() / kPathsPerSecond;
  return result;
}

void print_estimate(const v1::FabricDescription& description, bool wants_json) {
  const FabricEstimate figures = estimate(description);
  if (wants_json) {
    nlohmann::json json{{"fabric", description.name()},
                        {"ends", figures.tile.ends},
                        {"picks", figures.tile.picks},
                        {"fibres", figures.tile.fibres},
                        {"segments", figures.tile.segments},
                        {"memory_bytes", figures.tile.memory_bytes},
                        {"cells", nullptr},
                        {"database_bytes", figures.database_bytes},
                        {"core_seconds", figures.core_seconds}};
    if (figures.cells) {
      json["cells"] = *figures.cells;
    }
    print_json(json);
    return;
  }
  fmt::print("fabric         {}\n", description.name());
  if (figures.tile.ends > 0) {
    fmt::print("tile           {} ends x {} picks\n", figures.tile.ends, figures.tile.picks);
  }
  fmt::print("fibres         {}\nsegments       {}\nmemory         {}\n", figures.tile.fibres,
             figures.tile.segments, format_bytes(figures.tile.memory_bytes));
  if (figures.cells) {
    fmt::print("cells          about {}\n", *figures.cells);
  } else {
    fmt::print("cells          known when the fibres are; their time and disk are not counted\n");
  }
  fmt::print("database       about {}\n", format_bytes(figures.database_bytes));
  const bool may_stop = description.precompute().target_standard_error() > 0;
  fmt::print("time           about {} on one core (within a factor of three{})\n",
             format_duration(figures.core_seconds),
             may_stop ? "; less where cells reach the target standard error early" : "");
}

}  // namespace weft::cli
