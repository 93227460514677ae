#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <glm/vec3.hpp>
#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "render/build_scene.h"
#include "render/draw.h"
#include "render/image.h"
#include "render/load_fabric.h"
#include "render/path_integrator.h"
#include "render/png.h"
#include "render/precomputed_integrator.h"
#include "render/scene_description.h"

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
    "  weft render silk.h5 --integrator path --local -o reference.exr --json";

struct RenderOptions {
  std::string coordinator;
  std::string fabric;
  std::string scene;
  std::string out;
  std::string png;
  std::string stderr_image;
  std::string integrator;
  std::string size;
  std::optional<std::uint32_t> samples;
  std::optional<std::uint64_t> seed;
  std::optional<std::uint32_t> max_scatterings;
  std::optional<float> exposure;
  unsigned threads = 0;
  bool local = false;
  bool single_only = false;
  bool multiple_only = false;
  bool floats = false;
  bool wants_json = false;
};

// The fabrics of one scene, each loaded once.
class Shelf {
 public:
  Shelf(std::string main_reference, std::string coordinator, render::Fabric::Wanted wanted)
      : main_reference_(std::move(main_reference)),
        coordinator_(std::move(coordinator)),
        wanted_(wanted) {}

  const render::LoadedFabric& take(const std::string& reference) {
    const std::string& named = reference.empty() ? main_reference_ : reference;
    const auto found = fabrics_.find(named);
    if (found != fabrics_.end()) {
      return found->second;
    }
    const std::filesystem::path path =
        render::is_description(named) ? named : resolve_fabric(named, coordinator_).string();
    return fabrics_.emplace(named, render::load_fabric(path, wanted_)).first->second;
  }
  [[nodiscard]] const std::map<std::string, render::LoadedFabric>& fabrics() const {
    return fabrics_;
  }

 private:
  std::string main_reference_;
  std::string coordinator_;
  render::Fabric::Wanted wanted_;
  std::map<std::string, render::LoadedFabric> fabrics_;
};

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

// The scene as it will be drawn: the flags stand above the file.
v1::Scene described_scene(const RenderOptions& options) {
  v1::Scene scene =
      options.scene.empty() ? render::default_scene() : render::load_scene(options.scene);
  apply_size(options.size, *scene.mutable_picture());
  if (options.samples) {
    scene.mutable_picture()->set_samples_per_pixel(*options.samples);
  }
  v1::Integration& integration = *scene.mutable_integration();
  if (options.seed) {
    integration.set_seed(*options.seed);
  }
  if (options.max_scatterings) {
    integration.set_max_scatterings(*options.max_scatterings);
  }
  if (!options.integrator.empty()) {
    integration.set_integrator(options.integrator == "path" ? v1::INTEGRATOR_PATH
                                                            : v1::INTEGRATOR_PRECOMPUTED);
  }
  if (options.local) {
    integration.set_local(true);
  }
  if (options.single_only) {
    integration.set_scattering(v1::SCATTERING_SINGLE_ONLY);
  } else if (options.multiple_only) {
    integration.set_scattering(v1::SCATTERING_MULTIPLE_ONLY);
  }
  render::expand_picture_defaults(scene);
  return scene;
}

render::Scattering scattering_of(const v1::Integration& integration) {
  switch (integration.scattering()) {
    case v1::SCATTERING_SINGLE_ONLY:
      return render::Scattering::kSingleOnly;
    case v1::SCATTERING_MULTIPLE_ONLY:
      return render::Scattering::kMultipleOnly;
    default:
      return render::Scattering::kAll;
  }
}

std::unique_ptr<render::Integrator> integrator_for(const v1::Scene& described,
                                                   const render::Scene& scene) {
  const v1::Integration& integration = described.integration();
  if (integration.integrator() == v1::INTEGRATOR_PATH) {
    render::PathSettings settings;
    settings.local = integration.local();
    settings.max_scatterings = integration.max_scatterings();
    settings.scattering = scattering_of(integration);
    return std::make_unique<render::PathIntegrator>(scene, settings);
  }
  return std::make_unique<render::PrecomputedIntegrator>(scene, scattering_of(integration));
}

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, print);
  if (!status.ok()) {
    throw core::Error(core::Code::kInternal, "the scene cannot be written as JSON");
  }
  return json;
}

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

// How the picture was made; nothing about when or where.
std::map<std::string, std::string> metadata(const v1::Scene& described, const Shelf& shelf,
                                            const render::Drawing& drawing) {
  nlohmann::json fabrics = nlohmann::json::object();
  for (const auto& [reference, loaded] : shelf.fabrics()) {
    fabrics[reference] = {{"name", loaded.name}, {"content_digest", loaded.content_digest}};
  }
  constexpr auto replace = nlohmann::json::error_handler_t::replace;  // a path may be no UTF-8
  return {{"weft.software", "weft 0.1.0"},
          {"weft.integrator", v1::Integrator_Name(described.integration().integrator())},
          {"weft.samples_per_pixel", std::to_string(described.picture().samples_per_pixel())},
          {"weft.seed", std::to_string(described.integration().seed())},
          {"weft.scene", json_of(described)},
          {"weft.fabrics", fabrics.dump(-1, ' ', false, replace)},
          {"weft.cloth_mean", triple(drawing.cloth_mean).dump()},
          {"weft.cloth_standard_error", triple(drawing.cloth_standard_error).dump()},
          {"weft.cloth_share", nlohmann::json(drawing.cloth_share).dump()}};
}

// A line that is redrawn, on a terminal only.
std::function<void(double)> progress_line() {
  if (isatty(fileno(stderr)) != 1) {
    return [](double) {};
  }
  return [](double share) {
    fmt::print(stderr, "\r\x1b[K{:3.0f} % drawn{}", 100 * share, share < 1 ? "" : "\n");
  };
}

void write_pictures(const RenderOptions& options, render::Drawing& drawing,
                    const std::map<std::string, std::string>& attributes) {
  const render::ExrPixels pixels =
      options.floats ? render::ExrPixels::kFloat : render::ExrPixels::kHalf;
  drawing.image.attributes = attributes;
  render::write_exr(options.out, drawing.image, pixels);
  if (!options.stderr_image.empty()) {
    drawing.standard_error.attributes = attributes;
    drawing.standard_error.attributes["weft.content"] = "standard error of each pixel";
    render::write_exr(options.stderr_image, drawing.standard_error, pixels);
  }
  if (!options.png.empty()) {
    const float exposure =
        options.exposure ? *options.exposure : render::automatic_exposure(drawing.image);
    render::write_png(options.png, drawing.image.width, drawing.image.height,
                      render::tone_mapped(drawing.image, exposure));
  }
}

void report(const RenderOptions& options, const v1::Scene& described,
            const render::Drawing& drawing, double load_seconds, double draw_seconds) {
  if (options.wants_json) {
    print_json({{"picture", options.out},
                {"png", options.png.empty() ? nlohmann::json() : nlohmann::json(options.png)},
                {"width", drawing.image.width},
                {"height", drawing.image.height},
                {"samples_per_pixel", described.picture().samples_per_pixel()},
                {"integrator", v1::Integrator_Name(described.integration().integrator())},
                {"cloth_mean", triple(drawing.cloth_mean)},
                {"cloth_standard_error", triple(drawing.cloth_standard_error)},
                {"cloth_share", drawing.cloth_share},
                {"load_seconds", load_seconds},
                {"draw_seconds", draw_seconds}});
    return;
  }
  fmt::print("{}{}: {} x {}, {} samples a pixel\n", options.out,
             options.png.empty() ? "" : " and " + options.png, drawing.image.width,
             drawing.image.height, described.picture().samples_per_pixel());
  fmt::print("mean of the cloth {:.4g} {:.4g} {:.4g}, standard error {:.2g} {:.2g} {:.2g}\n",
             drawing.cloth_mean.x, drawing.cloth_mean.y, drawing.cloth_mean.z,
             drawing.cloth_standard_error.x, drawing.cloth_standard_error.y,
             drawing.cloth_standard_error.z);
  fmt::print("loaded in {}, drawn in {}\n", format_duration(load_seconds),
             format_duration(draw_seconds));
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
  const bool precomputed = described.integration().integrator() == v1::INTEGRATOR_PRECOMPUTED;
  Shelf shelf(
      options.fabric, options.coordinator,
      precomputed ? render::Fabric::Wanted::kFibresAndTransfer : render::Fabric::Wanted::kFibres);
  const render::Scene scene = render::build_scene(
      described, [&](const std::string& reference) { return shelf.take(reference).fabric; });
  for (const std::string& remark : scene.remarks) {
    fmt::print(stderr, "weft: {}\n", remark);
  }
  const std::unique_ptr<render::Integrator> integrator = integrator_for(described, scene);
  const double load_seconds = loading.seconds();

  render::DrawSettings settings;
  settings.width = described.picture().width();
  settings.height = described.picture().height();
  settings.samples_per_pixel = described.picture().samples_per_pixel();
  settings.seed = described.integration().seed();
  settings.threads = options.threads;
  const core::Stopwatch drawing_time;
  render::Drawing drawing = render::draw(scene.camera, *integrator, settings, progress_line(),
                                         [&] { return interrupt.requested(); });
  const double draw_seconds = drawing_time.seconds();
  write_pictures(options, drawing, metadata(described, shelf, drawing));
  report(options, described, drawing, load_seconds, draw_seconds);
}

}  // namespace

void add_render(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "render", kHelp);
  command->add_option("fabric", options->fabric, "Database, published version or description")
      ->required();
  command->add_option("-o,--output", options->out, "Picture to write (.exr)")->required();
  command->add_option("--png", options->png, "Preview to write as well (.png)");
  command->add_option("--exposure", options->exposure,
                      "Stops that brighten the preview; default: its mean becomes middle grey");
  command->add_option("--stderr-image", options->stderr_image,
                      "Standard error of every pixel, to write as well (.exr)");
  command->add_flag("--float", options->floats, "Write 32-bit pixels in place of 16-bit ones");
  command->add_option("--scene", options->scene, "Scene to draw (.textproto or .json)");
  command
      ->add_option("--integrator", options->integrator,
                   "path: every fibre, all bounces; precomputed: the database's transfer")
      ->check(CLI::IsMember({"path", "precomputed"}));
  command->add_flag("--local", options->local,
                    "Path integrator: end paths that leave the cloth, as the precomputation does");
  command->add_option("--max-scatterings", options->max_scatterings,
                      "Path integrator: end paths after as many; 0: no limit");
  command->add_option("--spp", options->samples, "Samples per pixel")
      ->check(CLI::Range(1, 1 << 20));
  command->add_option("--size", options->size, "WIDTHxHEIGHT in pixels");
  command->add_option("--threads", options->threads, "Threads; default: all the machine has")
      ->check(CLI::Range(0, 1024));
  command->add_option("--seed", options->seed, "Seed of the samples");
  auto* single =
      command->add_flag("--single-only", options->single_only, "Light scattered once alone");
  command
      ->add_flag("--multiple-only", options->multiple_only, "Light scattered more than once alone")
      ->excludes(single);
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value on stdout");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
