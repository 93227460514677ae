#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/end_in_time.h"
#include "cli/fabric_reference.h"
#include "cli/fabric_shelf.h"
#include "cli/interruption.h"
#include "cli/list_devices.h"
#include "cli/picture_files.h"
#include "cli/progress.h"
#include "cli/render_device.h"
#include "cli/render_options.h"
#include "cli/render_report.h"
#include "core/digest.h"
#include "core/error.h"
#include "render/animation.h"
#include "render/draw_pictures.h"
#include "render/make_integrator.h"
#include "render/node/node_client.h"

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
    "  weft render silk@3 --node 127.0.0.1:7412 --scene drape.textproto -o drape.exr\n"
    "  weft render --again drape.exr -o same.exr\n"
    "  weft render --list-devices";

// Longer than what cannot be broken off takes: reading a database, writing a picture.
constexpr double kGraceSeconds = 10;

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

// Before anything is drawn: a frame an hour from now wants its mesh, too.
void check_files_are_there(const v1::Scene& scene) {
  for (const std::string& file : render::files_of(scene)) {
    if (::access(file.c_str(), R_OK) != 0) {
      throw core::Error(core::Code::kNotFound,
                        "there is no file " + file +
                            " that can be read, and the scene names it; its path is looked for "
                            "from the scene's folder");
    }
  }
}

void draw_here(const RenderOptions& options, const v1::Scene& scene,
               const std::function<bool()>& should_stop, FabricShelf& shelf, PictureFiles& files) {
  const std::unique_ptr<render::gpu::DeviceRenderer> device =
      open_render_device(options.device, scene);
  render::PictureSettings settings;
  settings.device = device.get();
  settings.threads = options.threads;
  settings.progressive = options.progressive;
  settings.environment_cache = environment_cache_folder();
  render::draw_pictures(
      scene, settings, [&](const std::string& reference) { return shelf.take(reference).fabric; },
      render::files_on_disk(), files, should_stop);
}

// What a node says before it draws, on a terminal only.
render::NodeReports node_reports() {
  if (isatty(fileno(stderr)) != 1) {
    return {};
  }
  return {[](std::uint32_t ahead) {
            if (ahead > 0) {
              fmt::print(stderr, "\r\x1b[Kwaiting; {} ahead", ahead);
            }
          },
          [](const v1::RenderFetching& fetching) {
            fmt::print(stderr, "\r\x1b[Kthe node fetches {}: {} of {}", fetching.fabric(),
                       format_bytes(fetching.bytes_here()), format_bytes(fetching.bytes_total()));
          }};
}

FabricIdentities identities_of(const render::NodeClient& node) {
  FabricIdentities identities;
  for (const auto& [reference, fabric] : node.fabrics()) {
    const auto digest = core::Digest::from_binary(fabric.content_digest());
    identities[reference] = {fabric.name(), digest ? digest->hex() : std::string()};
  }
  return identities;
}

// A node opens no path of ours.
void check_published(const v1::Scene& scene) {
  for (const std::string& reference : render::fabrics_of(scene)) {
    if (!parse_reference(reference)) {
      throw core::Error(core::Code::kInvalidArgument,
                        reference +
                            ": a render node draws published fabrics only, such as silk or "
                            "silk@3; publish it with 'weft submit', or draw it without "
                            "--node");
    }
  }
}

void run(RenderOptions options) {
  if (options.fabric.empty() && options.again.empty()) {
    throw CLI::RequiredError("fabric");
  }
  const Interruption interruption(1);
  const v1::Scene scene = described_scene(options);
  const auto should_stop = [&] { return interruption.requested(); };
  FabricShelf shelf(options.fabric, options.coordinator,
                    render::reads_transfer(scene.integration().integrator())
                        ? render::Fabric::Wanted::kFibresAndTransfer
                        : render::Fabric::Wanted::kFibres,
                    should_stop);
  std::optional<render::NodeClient> node;
  if (!options.node.empty()) {
    if (options.device != "auto") {
      throw core::Error(core::Code::kInvalidArgument,
                        "--device " + options.device +
                            ": a render node draws on the device it was started with; leave "
                            "--device away, or draw without --node");
    }
    check_published(scene);
    node.emplace(security::Endpoint(options.node, options.coordinator.tls_folder,
                                    options.coordinator.insecure));
  }
  const auto identities = [&] { return node ? identities_of(*node) : shelf.identities(); };
  PictureFiles files(options, scene, identities);
  check_files_are_there(scene);
  const EndInTime end(interruption, kGraceSeconds,
                      "stopped; pictures that were done stay, and --resume skips them");
  try {
    if (node) {
      node->draw_pictures(scene, options.progressive, render::files_on_disk(), files,
                          node_reports(), should_stop);
    } else {
      draw_here(options, scene, should_stop, shelf, files);
    }
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kCancelled) {
      throw;
    }
    throw core::Error(core::Code::kCancelled, "stopped; " + files.what_is_kept());
  }
  if (!options.again.empty()) {
    warn_of_changed_fabrics(options.again, identities());
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
