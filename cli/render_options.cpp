#include "cli/render_options.h"

#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "cli/client.h"
#include "cli/picture_metadata.h"
#include "core/error.h"
#include "proto/address.h"
#include "render/environment_fit.h"
#include "render/image.h"
#include "render/layers.h"
#include "render/make_integrator.h"
#include "render/scene_description.h"

namespace weft::cli {

namespace {

void apply_size(const std::string& text, v1::Picture& picture) {
  if (text.empty()) {
    return;
  }
  unsigned width = 0;
  unsigned height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%ux%u%c", &width, &height, &rest) != 2 || width == 0 ||
      height == 0 || width > render::kImageSideLimit || height > render::kImageSideLimit) {
    throw core::Error(core::Code::kInvalidArgument,
                      fmt::format("--size {}: no picture size; write WIDTHxHEIGHT, such as "
                                  "1024x768, each from 1 to {}",
                                  text, render::kImageSideLimit));
  }
  picture.set_width(width);
  picture.set_height(height);
}

v1::TermSource named_source(const std::string& name, v1::TermSource otherwise) {
  static const std::map<std::string, v1::TermSource> sources{{"database", v1::TERM_SOURCE_DATABASE},
                                                             {"cell", v1::TERM_SOURCE_CELL},
                                                             {"segment", v1::TERM_SOURCE_SEGMENT}};
  const auto found = sources.find(name);
  return found == sources.end() ? otherwise : found->second;
}

std::string mistake_in_layers(const std::string& text) {
  try {
    static_cast<void>(render::parse_layers(text));
  } catch (const core::Error& error) {
    return error.what();
  }
  return "";
}

// Pictures are OpenEXR whatever they are called; under these names nobody would open them as such.
std::string mistake_in_picture_name(const std::string& name) {
  const std::string ending = std::filesystem::path(name).extension().string();
  return ending == ".png" || ending == ".jpg" || ending == ".jpeg" || ending == ".tif"
             ? name + " would hold OpenEXR: name it .exr; --png FILE writes a PNG as well"
             : "";
}

}  // namespace

v1::Scene described_scene(RenderOptions& options) {
  v1::Scene scene;
  if (!options.again.empty()) {
    RecordedPicture recorded = read_recipe(options.again);
    scene = std::move(recorded.scene);
    options.floats = options.floats || recorded.pixels == render::ExrPixels::kFloat;
    if (options.device == "auto" && options.node.empty() && !recorded.device.empty() &&
        (recorded.device == "cpu" || render::draws_on_device(scene.integration()))) {
      options.device = recorded.device;
    }
  } else if (!options.scene.empty()) {
    scene = render::load_scene(options.scene);
  } else {
    scene = render::default_scene();
  }
  apply_size(options.size, *scene.mutable_picture());
  if (options.samples) {
    scene.mutable_picture()->set_samples_per_pixel(*options.samples);
  }
  if (options.layers) {
    render::set_layers(render::parse_layers(*options.layers), *scene.mutable_picture());
  }
  v1::Integration& integration = *scene.mutable_integration();
  if (options.seed) {
    integration.set_seed(*options.seed);
  }
  if (options.max_scatterings) {
    integration.set_max_scatterings(*options.max_scatterings);
  }
  if (options.target_error) {
    integration.set_target_error(*options.target_error);
  }
  if (!options.integrator.empty()) {
    integration.set_integrator(render::integrators_by_name().at(options.integrator));
  }
  if (options.local) {
    integration.set_local(true);
  }
  if (options.single_only) {
    integration.set_scattering(v1::SCATTERING_SINGLE_ONLY);
  } else if (options.multiple_only) {
    integration.set_scattering(v1::SCATTERING_MULTIPLE_ONLY);
  }
  if (options.paper) {
    integration.set_paper(true);
  }
  if (options.environment_lights) {
    integration.set_environment_lights(*options.environment_lights);
  }
  integration.set_single_from(named_source(options.single_from, integration.single_from()));
  integration.set_multiple_from(named_source(options.multiple_from, integration.multiple_from()));
  render::complete_scene(scene, options.fabric);
  return scene;
}

namespace {

void add_file_options(CLI::App& command, RenderOptions& options) {
  command.add_option("fabric", options.fabric,
                     "Database, published version or description; not needed with --again");
  command
      .add_option("-o,--output", options.out,
                  "Picture to write (.exr); of an animation with a place for the number of the "
                  "frame, such as frame_%04d.exr")
      ->check(mistake_in_picture_name)
      ->required();
  command.add_option("--png", options.png, "Preview to write as well (.png)");
  command.add_option("--exposure", options.exposure,
                     "Stops that brighten the preview; default: its mean becomes middle grey");
  command.add_option("--stderr-image", options.stderr_image,
                     "Standard error of every pixel, to write as well (.exr)");
  command.add_flag("--float", options.floats, "Write 32-bit pixels in place of 16-bit ones");
  command
      .add_option("--layers", options.layers,
                  "Layers of the .exr besides its colour, with commas: single, multiple, shadow, "
                  "segment, tangent, normal, variance; or all")
      ->check(mistake_in_layers);
  auto* scene = command.add_option("--scene", options.scene, "Scene to draw (.textproto or .json)");
  command
      .add_option("--again", options.again,
                  "Draw what this picture (.exr) shows again, from what its header says")
      ->excludes(scene);
  command.add_flag("--progressive", options.progressive,
                   "Refine the files pass by pass; Ctrl-C keeps the last whole pass");
  auto* resume =
      command.add_flag("--resume", options.resume,
                       "Skip pictures that are on disk already, drawn from the same scene");
  command
      .add_option("--node", options.node,
                  "Let a render node draw: host:port or unix:/path; default: in process")
      ->envname("WEFT_RENDER_NODE")
      ->check(CLI::Validator(v1::mistake_in_address, "", "address"))
      ->excludes(resume);
}

void add_drawing_options(CLI::App& command, RenderOptions& options) {
  command
      .add_option("--integrator", options.integrator,
                  "path: every fibre, all bounces; precomputed: the database's transfer; dual: "
                  "dual scattering; prt: a transfer matrix per segment (slow: small crops)")
      ->check(CLI::IsMember(render::integrators_by_name()));
  command.add_flag(
      "--local", options.local,
      "Path and dual integrator: end paths that leave the cloth, as the precomputation does");
  command.add_option("--max-scatterings", options.max_scatterings,
                     "Path integrator: end paths after as many; 0: no limit");
  command
      .add_option("--environment-lights", options.environment_lights,
                  "Spherical Gaussians fitted to an environment; 0: draw directions from it")
      ->check(CLI::Range(0U, render::kMostFittedLights));
  command.add_option("--spp", options.samples, "Samples per pixel")->check(CLI::Range(1, 1 << 20));
  command
      .add_option("--target-error", options.target_error,
                  "Fewer samples where a pixel's standard error would be below this share of its\n"
                  "brightness, such as 0.02; --spp is the most (CPU)")
      ->check(CLI::Range(0.0, 10.0));
  command.add_option("--size", options.size, "WIDTHxHEIGHT in pixels");
  command.add_flag("--paper", options.paper,
                   "Precomputed integrator: shade Gaussian lights by the paper's choices");
  command
      .add_option("--device", options.device,
                  "What draws the precomputed integrator: auto (a GPU, else the CPU), "
                  "cpu, or an index or name of --list-devices")
      ->capture_default_str();
  command
      .add_option("--threads", options.threads, "Threads of the CPU; default: all the machine has")
      ->check(CLI::Range(0, 1024));
  command.add_option("--seed", options.seed, "Seed of the samples");
  auto* single =
      command.add_flag("--single-only", options.single_only, "Light scattered once alone");
  command
      .add_flag("--multiple-only", options.multiple_only, "Light scattered more than once alone")
      ->excludes(single);
  command
      .add_option("--single-from", options.single_from,
                  "Where light scattered once is taken from: the database, or rays traced from\n"
                  "where the segment's tables were baked (CPU)")
      ->check(CLI::IsMember({"database", "segment"}));
  command
      .add_option("--multiple-from", options.multiple_from,
                  "Where the rest is taken from: the database, paths from the hit's segment, or\n"
                  "paths from segments drawn from its cell (CPU)")
      ->check(CLI::IsMember({"database", "cell", "segment"}));
  add_coordinator_option(command, options.coordinator);
  command.add_flag("--json", options.wants_json, "Print one JSON value on stdout");
}

}  // namespace

void add_render_options(CLI::App& command, RenderOptions& options) {
  add_file_options(command, options);
  add_drawing_options(command, options);
}

}  // namespace weft::cli
