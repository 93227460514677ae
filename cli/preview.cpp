#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/fibre_colours.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "cli/quality.h"
#include "cli/tile_picture.h"
#include "core/clock.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "render/png.h"

namespace weft::cli {

namespace {

constexpr double kObliqueTilt = 52 * std::numbers::pi / 180;
constexpr double kObliqueTurn = 32 * std::numbers::pi / 180;
// Without --width-mm a view shows this many threads or one tile, whichever is more.
constexpr double kThreadsShown = 14;

struct PreviewOptions {
  std::string fabric;
  std::string out;
  std::string view = "both";
  std::string quality;
  std::uint32_t pixels = 800;
  double width_mm = 0;
  bool json = false;
};

double shown_width_mm(const PreviewOptions& options, const fabric::Tile& tile) {
  if (options.width_mm > 0) {
    return options.width_mm;
  }
  double ends = 0;
  for (const fabric::Thread& thread : tile.threads) {
    ends += thread.role == fabric::Role::kWarp ? 1 : 0;
  }
  const double across = tile.size_mm.x;
  return ends > 0 ? std::max(across, across / ends * kThreadsShown) : 2 * across;
}

void draw(const PreviewOptions& options, const v1::FabricDescription& description,
          const fabric::Tile& tile) {
  PictureView view;
  view.width = view.height = options.pixels;
  view.width_mm = shown_width_mm(options, tile);
  const std::vector<glm::vec3> colours = fibre_colours(description, tile);
  std::vector<std::vector<std::uint8_t>> pictures;
  if (options.view != "oblique") {
    pictures.push_back(draw_tile(tile, colours, view));
  }
  if (options.view != "top") {
    view.tilt_rad = kObliqueTilt;
    view.turn_rad = kObliqueTurn;
    view.width_mm *= 0.6;
    pictures.push_back(draw_tile(tile, colours, view));
  }
  std::vector<std::uint8_t> rows;
  const std::size_t row_bytes = std::size_t{3} * options.pixels;
  for (std::size_t y = 0; y < options.pixels; ++y) {
    for (const std::vector<std::uint8_t>& picture : pictures) {
      const auto* row = picture.data() + y * row_bytes;
      rows.insert(rows.end(), row, row + row_bytes);
    }
  }
  render::write_png(options.out, options.pixels * static_cast<std::uint32_t>(pictures.size()),
                    options.pixels, rows);
}

void preview(const PreviewOptions& options) {
  const core::Stopwatch stopwatch;
  const v1::FabricDescription description =
      fabric::load_description(options.fabric, parse_quality(options.quality));
  const fabric::TileEstimate estimate = fabric::estimate_tile(description);
  fabric::RelaxReport relaxed;
  fabric::UntangleReport untangled;
  const fabric::Tile tile =
      fabric::build_tile(description, {.relaxed = &relaxed, .untangled = &untangled});
  const double build_seconds = stopwatch.seconds();
  draw(options, description, tile);
  const double seconds = stopwatch.seconds();
  if (options.json) {
    const nlohmann::json summary = {{"fabric", description.name()},
                                    {"picture", options.out},
                                    {"size_mm", {tile.size_mm.x, tile.size_mm.y}},
                                    {"height_mm", tile.z_max_mm - tile.z_min_mm},
                                    {"threads", tile.threads.size()},
                                    {"fibres", tile.strands.size()},
                                    {"segments", tile.segment_count()},
                                    {"deepest_overlap_share", relaxed.overlap_share},
                                    {"relax_iterations", relaxed.iterations},
                                    {"buried_share", untangled.buried_share},
                                    {"untangle_iterations", untangled.iterations},
                                    {"memory_bytes", estimate.memory_bytes},
                                    {"build_seconds", build_seconds},
                                    {"seconds", seconds}};
    print_json(summary);
    return;
  }
  std::printf("%s: tile of %.4g x %.4g mm, %.3g mm thick\n", description.name().c_str(),
              static_cast<double>(tile.size_mm.x), static_cast<double>(tile.size_mm.y),
              static_cast<double>(tile.z_max_mm - tile.z_min_mm));
  std::printf("%zu threads, %zu fibres, %u segments, %s\n", tile.threads.size(),
              tile.strands.size(), tile.segment_count(),
              format_bytes(estimate.memory_bytes).c_str());
  std::printf("yarns overlap by at most %.1f %% of the thinner radius (%u iterations)\n",
              100 * relaxed.overlap_share, relaxed.iterations);
  std::printf("%.2f %% of the segments' midpoints lie inside another fibre (%u iterations)\n",
              100 * untangled.buried_share, untangled.iterations);
  std::printf("%s drawn in %s\n", options.out.c_str(), format_duration(seconds).c_str());
}

}  // namespace

void add_preview(CLI::App& app) {
  auto options = std::make_shared<PreviewOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "preview",
                                  "Draw a fabric's fibres, before anything is precomputed.\n"
                                  "Example: weft preview silk.textproto -o silk.png");
  command->add_option("fabric", options->fabric, "Fabric description (.textproto or .json)")
      ->required();
  command->add_option("-o,--output,--out", options->out, "Picture to write (.png)")->required();
  command->add_option("--view", options->view, "What to draw: top, oblique or both side by side")
      ->check(CLI::IsMember({"top", "oblique", "both"}))
      ->capture_default_str();
  command->add_option("--pixels", options->pixels, "Side of one view, in pixels")
      ->check(CLI::Range(16, 8192))
      ->capture_default_str();
  command
      ->add_option("--width-mm", options->width_mm,
                   "Width of cloth to show (default: a tile, at least 14 ends)")
      ->check(CLI::Range(1e-3, 1e4));
  add_quality_option(*command, options->quality);
  command->add_flag("--json", options->json, "Print one JSON value");
  command->callback([options] { preview(*options); });
}

}  // namespace weft::cli
