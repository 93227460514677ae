#include <cstdio>
#include <functional>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/fabric_shelf.h"
#include "cli/list_devices.h"
#include "cli/picture_files.h"
#include "cli/render_options.h"
#include "cli/render_report.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "render/draw_pictures.h"
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

// Pictures drawn again from headers: a fabric may have changed under its name.
void warn_of_changed_fabrics(const std::string& again, const FabricIdentities& now) {
  for (const auto& [reference, recorded] : read_recipe(again).fabrics) {
    const auto found = now.find(reference);
    if (found != now.end() && found->second.content_digest != recorded.content_digest) {
      fmt::print(stderr, "weft: {} is not what it was when {} was drawn; the picture will differ\n",
                 reference, again);
    }
  }
}

void draw_here(const RenderOptions& options, const v1::Scene& scene,
               const std::function<bool()>& should_stop, FabricShelf& shelf, PictureFiles& files) {
  render::PictureSettings settings;
  settings.threads = options.threads;
  settings.progressive = options.progressive;
  settings.environment_cache = environment_cache_folder();
  render::draw_pictures(
      scene, settings, [&](const std::string& reference) { return shelf.take(reference).fabric; },
      render::files_on_disk(), files, should_stop);
}

void run(RenderOptions options) {
  if (options.fabric.empty() && options.again.empty()) {
    throw CLI::RequiredError("fabric");
  }
  core::Interrupt interrupt;
  const v1::Scene scene = described_scene(options);
  FabricShelf shelf(options.fabric, options.coordinator,
                    render::reads_transfer(scene.integration().integrator())
                        ? render::Fabric::Wanted::kFibresAndTransfer
                        : render::Fabric::Wanted::kFibres);
  PictureFiles files(options, scene, [&] { return shelf.identities(); });
  try {
    draw_here(
        options, scene, [&] { return interrupt.requested(); }, shelf, files);
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kCancelled) {
      throw;
    }
    throw core::Error(core::Code::kCancelled, "stopped; " + files.what_is_kept());
  }
  if (!options.again.empty()) {
    warn_of_changed_fabrics(options.again, shelf.identities());
  }
  report_pictures(options, scene, files.written());
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
