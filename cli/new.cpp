#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/output_file.h"
#include "cli/print_json.h"
#include "core/error.h"
#include "core/file.h"
#include "core/mistakes.h"
#include "fabric/presets.h"

namespace weft::cli {

namespace {

struct NewCommand {
  std::string preset;
  std::string out;
  bool list = false;
  bool force = false;
  bool json = false;
};

// The first line of a text's leading comment, without its mark.
std::string first_line(std::string_view text) {
  std::string line(text.substr(0, text.find('\n')));
  return line.starts_with("# ") ? line.substr(2) : line;
}

void list_presets(bool wants_json) {
  nlohmann::json value = nlohmann::json::object();
  for (const char* kind : {"fabric", "yarn", "material"}) {
    nlohmann::json names = nlohmann::json::array();
    if (!wants_json) {
      std::printf("%ss\n", kind);
    }
    for (const std::string& name : fabric::embedded_names(kind)) {
      names.push_back(name);
      if (!wants_json) {
        std::printf("  %-14s %s\n", name.c_str(),
                    first_line(*fabric::embedded_text(kind, name)).c_str());
      }
    }
    value[std::string(kind) + "s"] = names;
  }
  if (wants_json) {
    print_json(value);
  }
}

// A plain weave of one yarn preset, its sett made for the yarn.
std::string plain_weave_of(const std::string& yarn) {
  const double per_cm = 4.2 / fabric::yarn_preset(yarn)->yarn_radius_mm();
  const std::string sett = std::to_string(static_cast<int>(per_cm));
  return "# A plain weave of the published yarn \"" + yarn +
         "\".\n"
         "# proto-file: proto/weft/v1/fabric.proto\n"
         "# proto-message: weft.v1.FabricDescription\n"
         "name: \"" +
         yarn +
         "\"\n"
         "weave {\n"
         "  # One row per pick, one character per end; X: the warp is on top.\n"
         "  matrix {\n    rows: \"X.\"\n    rows: \".X\"\n  }\n"
         "  ends_per_cm: " +
         sett + "\n  picks_per_cm: " + sett +
         "\n"
         "  warp_yarn: \"" +
         yarn + "\"\n  weft_yarn: \"dyed\"\n}\n" +
         "# A yarn of your own begins with a preset; every field that is set here replaces the "
         "preset's.\n"
         "yarns {\n  name: \"dyed\"\n  preset: \"" +
         yarn +
         "\"\n  material: \"dye\"\n}\n"
         "# Colours are linear: what a fibre reflects (c_r) and lets through (c_tt).\n"
         "materials {\n  name: \"dye\"\n  preset: \"" +
         fabric::yarn_preset(yarn)->material() +
         "\"\n  c_tt { r: 0.15 g: 0.35 b: 0.75 }\n}\n"
         "exemplar {\n  repeats_x: 1  # more repeats vary the fibres\n  repeats_y: 1\n}\n"
         "precompute {\n  quality: QUALITY_PAPER  # or QUALITY_PREVIEW, QUALITY_BEST\n}\n"
         "seed: 1\n";
}

// The text that a preset stands for: a fabric, the first fabric whose name begins so, or a plain
// weave of a yarn, or of the first yarn of a material.
std::string preset_text(const std::string& preset) {
  if (const auto text = fabric::embedded_text("fabric", preset)) {
    return std::string(*text);
  }
  std::vector<std::string> known{"silk", "satin", "shot_silk", "cotton", "polyester", "rayon"};
  for (const std::string& name : fabric::embedded_names("fabric")) {
    if (name.starts_with(preset + "_")) {
      return std::string(*fabric::embedded_text("fabric", name));
    }
    known.push_back(name);
  }
  for (const std::string& name : fabric::embedded_names("yarn")) {
    if (name == preset || (name.starts_with(preset) && name.size() == preset.size() + 1)) {
      return plain_weave_of(name);
    }
    known.push_back(name);
  }
  throw core::Error(core::Code::kNotFound, "there is no preset " + core::in_quotes(preset) +
                                               core::suggestion(preset, known) +
                                               "; weft new --list shows them all");
}

void write_new(const NewCommand& command) {
  if (command.list) {
    list_presets(command.json);
    return;
  }
  const std::string text = preset_text(command.preset);
  if (command.out.empty()) {
    if (command.json) {
      print_json(nlohmann::json({{"text", text}}));
    } else {
      std::fputs(text.c_str(), stdout);
    }
    return;
  }
  check_output_file(command.out);
  if (!command.force && std::filesystem::exists(command.out)) {
    throw core::Error(core::Code::kAlreadyExists,
                      command.out + " exists already; choose another file, or --force");
  }
  core::write_file_atomically(command.out, text);
  if (command.json) {
    print_json(nlohmann::json({{"description", command.out}}));
  } else {
    std::printf("%s written; edit it, then: weft preview %s -o picture.png\n", command.out.c_str(),
                command.out.c_str());
  }
}

}  // namespace

void add_new(CLI::App& app) {
  auto command = std::make_shared<NewCommand>();  // shared: the callback outlives this function
  CLI::App* new_app = add_command(app, "new",
                                  "Start a fabric description.\n"
                                  "Without -o the description goes to standard output.\n"
                                  "Examples: weft new --preset silk -o silk.textproto\n"
                                  "          weft new --list");
  CLI::Option* preset =
      new_app->add_option("--preset", command->preset,
                          "A fabric (silk_plain, gabardine, ...) or a yarn (cotton1, ...)");
  CLI::Option* list = new_app->add_flag("--list", command->list, "List the presets");
  preset->excludes(list);
  new_app->add_option("-o,--output,--out", command->out, "Description to write (.textproto)")
      ->excludes(list);
  new_app->add_flag("--force", command->force, "Replace a file that exists");
  new_app->add_flag("--json", command->json, "Print one JSON value");
  new_app->callback([command] {
    if (!command->list && command->preset.empty()) {
      throw CLI::RequiredError("--preset or --list");
    }
    write_new(*command);
  });
}

}  // namespace weft::cli
