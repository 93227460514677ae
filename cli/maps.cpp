#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/add_command.h"
#include "cli/client.h"
#include "cli/commands.h"
#include "cli/fabric_reference.h"
#include "cli/gltf_material.h"
#include "cli/map_set.h"
#include "cli/print_json.h"
#include "cli/u3m.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "fabric/description.h"
#include "render/load_fabric.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Bake a fabric into pictures that tile, for renderers that know no fibres.\n"
    "FABRIC is a database (.h5) or a published version (silk, silk@3). The folder gets base "
    "colour,\n"
    "normal, height, roughness, anisotropy, transmission and coverage of one tile as PNG, "
    "maps.json\n"
    "with their physical size, a glTF material (NAME.gltf) and a Unified 3D Material (NAME.u3m).\n"
    "Times in it are SOURCE_DATE_EPOCH where that is set.\n"
    "Example: weft maps silk.h5 -o silk_maps --size 512";

constexpr std::uint32_t kSizeLimit = 4096;
constexpr std::uint32_t kSamplesLimit = 1024;

struct MapsOptions {
  security::Endpoint coordinator;
  std::string fabric;
  std::string out;
  std::uint32_t size = 256;
  std::uint32_t samples = 16;
  unsigned threads = 0;
  std::uint64_t seed = 1;
  bool wants_json = false;
};

// Now, or the time that builds which must not depend on it name (reproducible-builds.org).
core::Clock::Time time_of_making() {
  const char* named = std::getenv("SOURCE_DATE_EPOCH");  // NOLINT(concurrency-mt-unsafe)
  if (named == nullptr) {
    return core::system_clock().now();
  }
  const std::string text = named;
  std::int64_t seconds = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error != std::errc() || end != text.data() + text.size() || seconds < 0 ||
      seconds > 253'402'300'799) {
    throw CLI::ValidationError("SOURCE_DATE_EPOCH",
                               "it is '" + text + "' and must be seconds since 1970");
  }
  return core::Clock::Time(std::chrono::seconds(seconds));
}

render::MapSettings settings_of(const MapsOptions& options, glm::vec2 size_mm) {
  // Square pixels, as near as whole ones come; the longer side has --size.
  const auto pixels = [&](float mm) {
    const float longer = std::max(size_mm.x, size_mm.y);
    return std::max(1U, static_cast<std::uint32_t>(
                            std::lround(static_cast<float>(options.size) * mm / longer)));
  };
  render::MapSettings settings;
  settings.width = pixels(size_mm.x);
  settings.height = pixels(size_mm.y);
  settings.samples = options.samples;
  settings.threads = options.threads;
  settings.seed = options.seed;
  return settings;
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder)) {
    throw core::Error(core::Code::kInvalidArgument,
                      folder.string() + " is no folder and cannot be made one; choose another -o");
  }
}

void report(const MapsOptions& options, const MapSet& set) {
  const render::MaterialMaps& maps = set.maps;
  if (options.wants_json) {
    nlohmann::json files = nlohmann::json::array();
    for (const MapFile& file : map_files()) {
      files.push_back(file.name);
    }
    for (const char* extension : {".gltf", ".bin", ".u3m"}) {
      files.push_back(set.name + extension);
    }
    files.push_back("maps.json");
    print_json({{"fabric", set.name},
                {"folder", options.out},
                {"files", files},
                {"pixels", {maps.width, maps.height}},
                {"size_mm", {maps.size_mm.x, maps.size_mm.y}}});
    return;
  }
  fmt::print("{}: {} pictures of {} x {} pixels, {:.4g} x {:.4g} mm; {}.gltf, {}.u3m\n",
             options.out, map_files().size(), maps.width, maps.height,
             static_cast<double>(maps.size_mm.x), static_cast<double>(maps.size_mm.y), set.name,
             set.name);
}

void run(const MapsOptions& options) {
  const core::Clock::Time now = time_of_making();
  const std::filesystem::path path = resolve_fabric(options.fabric, options.coordinator);
  const render::LoadedFabric loaded =
      render::load_fabric(path, render::Fabric::Wanted::kFibresAndTransfer);
  make_folder(options.out);
  MapSet set;
  set.name = loaded.name.empty() ? "fabric" : loaded.name;
  set.reference = options.fabric;
  set.content_digest = loaded.content_digest;
  set.description = fabric::parse_description(
      loaded.fabric->precomputed()->database().description_json, path.string() + ".json", ".");
  set.tile = &loaded.fabric->tile();
  core::Interrupt interrupt;
  const bool shows = !options.wants_json && isatty(fileno(stderr)) == 1;
  set.maps = render::bake_maps(
      *loaded.fabric, settings_of(options, loaded.fabric->tile().size_mm),
      [&](double share) {
        if (shows) {
          fmt::print(stderr, "\r\x1b[Kbaking {:.0f} %", 100 * share);
        }
      },
      [&] { return interrupt.requested(); });
  if (shows) {
    fmt::print(stderr, "\r\x1b[K");
  }
  write_maps(set, options.out);
  write_gltf_material(set, options.out);
  write_u3m(set, options.out, now);
  report(options, set);
}

}  // namespace

void add_maps(CLI::App& app) {
  auto options = std::make_shared<MapsOptions>();  // shared: the callback outlives this function
  CLI::App* command = add_command(app, "maps", kHelp);
  command->add_option("fabric", options->fabric, "Database (.h5) or published version")->required();
  command->add_option("-o,--output", options->out, "Folder to write into; made when missing")
      ->option_text("FOLDER")
      ->required();
  command->add_option("--size", options->size, "Pixels of the tile's longer side")
      ->check(CLI::Range(8U, kSizeLimit))
      ->capture_default_str();
  command->add_option("--samples", options->samples, "Eye rays of a pixel")
      ->check(CLI::Range(1U, kSamplesLimit))
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Threads (default: the machine's)");
  command->add_option("--seed", options->seed, "Seed of the random numbers")->capture_default_str();
  add_coordinator_option(*command, options->coordinator);
  command->add_flag("--json", options->wants_json, "Print one JSON value");
  command->callback([options] { run(*options); });
}

}  // namespace weft::cli
