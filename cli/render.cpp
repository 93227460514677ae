#include <cstdio>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/fabric_shelf.h"
#include "cli/list_devices.h"
#include "cli/output_file.h"
#include "cli/render_options.h"
#include "cli/render_report.h"
#include "core/clock.h"
#include "core/interrupt.h"
#include "render/build_scene.h"
#include "render/draw.h"
#include "render/environment_cache.h"
#include "render/make_integrator.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Draw a picture of a fabric with every fibre.\n"
    "FABRIC is a database (.h5), a published version (silk, silk@3, silk@latest) or, for the path\n"
    "integrator, a description (.textproto). Without a scene: a flat swatch under a soft key "
    "light.\n"
    "Examples:\n"
    "  weft render silk.h5 -o silk.exr --png silk.png\n"
    "  weft render silk@3 --scene drape.textproto --size 1024x768 --spp 256 -o drape.exr\n"
    "  weft render silk.h5 --integrator path --local -o reference.exr --json\n"
    "  weft render --list-devices";

// A line that is redrawn, on a terminal only.
std::function<void(double)> progress_line() {
  if (isatty(fileno(stderr)) != 1) {
    return [](double) {};
  }
  return [](double share) {
    fmt::print(stderr, "\r\x1b[K{:3.0f} % drawn{}", 100 * share, share < 1 ? "" : "\n");
  };
}

void run(const RenderOptions& options) {
  core::Interrupt interrupt;
  for (const std::string& file : {options.out, options.png, options.stderr_image}) {
    if (!file.empty()) {
      check_output_file(file);
    }
  }
  const v1::Scene described = described_scene(options);
  const core::Stopwatch loading;
  const bool transfer = render::reads_transfer(described.integration().integrator());
  FabricShelf shelf(
      options.fabric, options.coordinator,
      transfer ? render::Fabric::Wanted::kFibresAndTransfer : render::Fabric::Wanted::kFibres);
  render::Scene scene = render::build_scene(
      described, [&](const std::string& reference) { return shelf.take(reference).fabric; });
  if (described.integration().environment_lights() > 0) {
    render::EnvironmentFitSettings fit;
    fit.most_lights = described.integration().environment_lights();
    render::fit_environments(scene, fit, environment_cache_folder());
  }
  for (const std::string& remark : scene.remarks) {
    fmt::print(stderr, "weft: {}\n", remark);
  }
  const render::LayerSet layers = render::layers_of(described.picture());
  const std::unique_ptr<render::Integrator> integrator =
      render::make_integrator(described.integration(), scene, layers.has(render::Layer::kShadow));
  const double load_seconds = loading.seconds();

  render::DrawSettings settings;
  settings.width = described.picture().width();
  settings.height = described.picture().height();
  settings.samples_per_pixel = described.picture().samples_per_pixel();
  settings.seed = described.integration().seed();
  settings.threads = options.threads;
  settings.layers = layers;
  const core::Stopwatch drawing_time;
  render::Drawing drawing = render::draw(scene.camera, *integrator, settings, progress_line(),
                                         [&] { return interrupt.requested(); });
  const double draw_seconds = drawing_time.seconds();
  write_pictures(options, layers, drawing, picture_metadata(described, shelf, drawing));
  report_drawing(options, described, drawing, load_seconds, draw_seconds);
}

}  // namespace

void add_render(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "render", kHelp);
  add_render_options(*command, *options);
  // Ends the parse, as --help does, so that no FABRIC is asked for; behind --json, which it reads.
  command->add_flag_callback(
      "--list-devices",
      [options] {
        list_devices(options->wants_json);
        throw CLI::Success();
      },
      "List the devices that can draw, and end");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
