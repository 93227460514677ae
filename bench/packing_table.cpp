// Prints how densely the fibres of fabrics lie, a row of a Markdown table for each
// (docs/geometry.md). Usage: bench_packing_table preview|paper FABRIC...

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "core/clock.h"
#include "core/random.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/ply.h"
#include "transport/cell_grid.h"
#include "transport/scene.h"
#include "transport/visibility_raster.h"
#include "transport/visibility_sg.h"

namespace weft {
namespace {

constexpr std::uint32_t kFlights = 20000;
constexpr std::uint32_t kImages = 1000;
constexpr std::uint32_t kImageResolution = 128;
constexpr std::uint32_t kHoleRays = 20000;

// Share of level cloth through which one sees straight down.
double holes(const transport::Scene& scene) {
  const fabric::Tile& tile = scene.tile();
  core::Random random(1, 0);
  std::uint32_t through = 0;
  for (std::uint32_t n = 0; n < kHoleRays; ++n) {
    const glm::vec3 from{random.uniform() * tile.size_mm.x, random.uniform() * tile.size_mm.y,
                         tile.z_max_mm};
    through += scene.occluded(from, {0, 0, -1}, 2 * (tile.z_max_mm - tile.z_min_mm), {}) ? 0 : 1;
  }
  return static_cast<double>(through) / kHoleRays;
}

// Share of segments that see no sky at all, and the mean share of the sphere that is seen.
struct Openness {
  double blocked_share = 0;
  double open_share = 0;
};
Openness openness(const transport::Scene& scene) {
  const transport::VisibilityRaster raster(scene, kImageResolution);
  core::Random random(2, 0);
  Openness sum;
  for (std::uint32_t n = 0; n < kImages; ++n) {
    const auto bits = raster.bits(random.below(scene.tile().segment_count()));
    const double open = transport::open_share(bits, kImageResolution);
    sum.blocked_share += open == 0 ? 1.0 / kImages : 0;
    sum.open_share += open / kImages;
  }
  return sum;
}

// Height that holds nine tenths of all segments: hairs make the tile itself thicker.
double middle_height_mm(const fabric::Tile& tile) {
  std::vector<float> heights;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    heights.push_back(tile.wrapped_midpoint(k).z);
  }
  std::sort(heights.begin(), heights.end());
  const auto at = [&heights](double share) {
    return heights[static_cast<std::size_t>(share * static_cast<double>(heights.size() - 1))];
  };
  return at(0.95) - at(0.05);
}

void print_row(const std::string& path, v1::Quality quality) {
  const v1::FabricDescription description = fabric::load_description(path, quality);
  const core::Stopwatch stopwatch;
  fabric::UntangleReport untangled;
  const fabric::Tile tile = fabric::build_tile(description, {.untangled = &untangled});
  const double seconds = stopwatch.seconds();
  const v1::Yarn& yarn = description.yarns(0);
  const fabric::YarnModel model = fabric::yarn_model(yarn, description.exemplar());
  const double radius = model.fibre_radius_mm;
  const double area =
      model.section.radial * model.section.tangential * model.yarn_radius_mm * model.yarn_radius_mm;
  const transport::Scene scene(tile);
  const double path_mm = transport::mean_free_path(scene, kFlights, description.seed());
  const transport::CellGrid grid =
      transport::make_cell_grid(tile, path_mm * description.precompute().cell_length_mfp());
  const Openness open = openness(scene);
  std::printf(
      "| %s | %zu | %u | %.2g | %.2f | %.2f x %.2f x %.2f (%.2f) | %.1f | %.1f | %.2f | %.0f | "
      "%.0f "
      "| %.1f | %zu | %.1f |\n",
      description.name().c_str(), tile.strands.size(), tile.segment_count(), radius,
      model.fibres_per_ply * radius * radius / area, static_cast<double>(tile.size_mm.x),
      static_cast<double>(tile.size_mm.y), static_cast<double>(tile.z_max_mm - tile.z_min_mm),
      middle_height_mm(tile), description.exemplar().segment_length_radii(),
      100 * untangled.buried_share, untangled.mean_moved_mm / radius, 100 * open.blocked_share,
      1000 * holes(scene), path_mm / radius, grid.cell_coordinates.size(), seconds);
  std::fflush(stdout);
}

}  // namespace
}  // namespace weft

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: %s preview|paper FABRIC...\n", argv[0]);
    return 2;
  }
  try {
    const bool preview = std::string(argv[1]) == "preview";
    std::printf(
        "| fabric | fibres | segments | radius mm | ply fill | tile mm (9/10 of it) | segment, "
        "radii "
        "| inside another %% | moved, radii | blocked %% | holes, per mille | mfp/radius | cells | "
        "built s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int k = 2; k < argc; ++k) {
      weft::print_row(argv[k], preview ? weft::v1::QUALITY_PREVIEW : weft::v1::QUALITY_PAPER);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
