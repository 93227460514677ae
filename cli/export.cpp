#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/fibre_colours.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "cli/quality.h"
#include "core/error.h"
#include "core/file.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "fabric/export_curves.h"

namespace weft::cli {

namespace {

const std::map<std::string, fabric::CurveFormat> kFormats = {{"pbrt", fabric::CurveFormat::kPbrt},
                                                             {"bcc", fabric::CurveFormat::kBcc},
                                                             {"obj", fabric::CurveFormat::kObj},
                                                             {"usda", fabric::CurveFormat::kUsda}};

struct CommandOptions {
  std::string fabric;
  std::string out;
  std::string format;
  std::string tiles = "1x1";
  std::string quality;
  bool json = false;
};

glm::uvec2 parse_tiles(const std::string& text) {
  unsigned x = 0;
  unsigned y = 0;
  int used = 0;
  // At most four digits each, so that nothing overflows.
  if (std::sscanf(text.c_str(), "%4ux%4u%n", &x, &y, &used) != 2 ||
      used != static_cast<int>(text.size()) || x == 0 || y == 0 || text[0] < '0') {
    throw CLI::ValidationError("--tiles",
                               text + " is not a number of tiles; write for example 3x2");
  }
  return {x, y};
}

fabric::CurveFormat format_of(const CommandOptions& options) {
  std::string name = options.format;
  if (name.empty()) {
    const std::size_t dot = options.out.rfind('.');
    name = dot == std::string::npos ? "" : options.out.substr(dot + 1);
  }
  const auto found = kFormats.find(name);
  if (found == kFormats.end()) {
    throw CLI::ValidationError(
        "--format", "the name '" + options.out + "' does not tell it; give pbrt, bcc, obj or usda");
  }
  return found->second;
}

void export_fabric(const CommandOptions& options) {
  fabric::ExportOptions export_options;
  export_options.format = format_of(options);
  export_options.tiles = parse_tiles(options.tiles);
  check_output_file(options.out);
  const v1::FabricDescription description =
      fabric::load_description(options.fabric, parse_quality(options.quality));
  const fabric::Tile tile = fabric::build_tile(description);
  export_options.albedos = fibre_colours(description, tile);
  const std::string bytes = fabric::export_curves(tile, export_options);
  core::write_file_atomically(options.out, bytes);
  const std::uint64_t copies = std::uint64_t{export_options.tiles.x} * export_options.tiles.y;
  if (options.json) {
    const nlohmann::json summary = {{"fabric", description.name()},
                                    {"file", options.out},
                                    {"curves", tile.strands.size() * copies},
                                    {"segments", tile.segment_count() * copies},
                                    {"bytes", bytes.size()}};
    print_json(summary);
    return;
  }
  std::printf("%s: %s curves, %s segments, %s\n", options.out.c_str(),
              std::to_string(tile.strands.size() * copies).c_str(),
              std::to_string(tile.segment_count() * copies).c_str(),
              format_bytes(bytes.size()).c_str());
}

}  // namespace

void add_export(CLI::App& app) {
  auto options = std::make_shared<CommandOptions>();  // shared: the callback outlives this function
  CLI::App* command =
      add_command(app, "export",
                  "Write a fabric's fibres as curves for other programs, in millimetres.\n"
                  "Example: weft export silk.textproto -o silk.bcc");
  command->add_option("fabric", options->fabric, "Fabric description (.textproto or .json)")
      ->required();
  command->add_option("-o,--output,--out", options->out, "File to write")->required();
  command
      ->add_option(
          "--format", options->format,
          "pbrt curves, Yuksel's binary curve collection (bcc), OBJ lines or USD text (usda) "
          "(default: by the file's extension)")
      ->check(CLI::IsMember({"pbrt", "bcc", "obj", "usda"}));
  command->add_option("--tiles", options->tiles, "Copies of the tile across x along")
      ->capture_default_str();
  add_quality_option(*command, options->quality);
  command->add_flag("--json", options->json, "Print one JSON value");
  command->callback([options] { export_fabric(*options); });
}

}  // namespace weft::cli
