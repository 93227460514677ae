#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cli/add_command.h"
#include "cli/commands.h"
#include "cli/print_json.h"
#include "cli/table.h"
#include "core/settings.h"

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Say what is set, and where.\n"
    "An option that is not on the command line is taken from its environment variable, else from "
    "the user's file (~/.config/weft/weft.toml, or what WEFT_CONFIG names), else from the "
    "machine's (/etc/weft/weft.toml), else it has its default. The files are TOML: keys above all "
    "sections are for every command that has such an option, those below [render] for 'weft "
    "render' alone, those below [weft-worker] for that program.\n"
    "Examples: weft config show\n"
    "          weft config show --json";

constexpr const char* kShowHelp =
    "List the settings, each with its value and where that is from.\n"
    "First those that commands share, then what the files set for single commands.\n"
    "Example: weft config show";

// One setting as it is shown.
struct Row {
  std::string section;
  std::string key;
  core::FoundSetting found;
};

std::vector<Row> rows_of(const core::Settings& settings) {
  std::vector<Row> rows;
  for (const core::SharedSetting& shared : core::shared_settings()) {
    core::FoundSetting otherwise;
    if (*shared.default_text != '\0') {
      otherwise.values = {shared.default_text};
    }
    rows.push_back(
        {"", shared.key, settings.find("", shared.key, shared.variable).value_or(otherwise)});
  }
  std::set<std::pair<std::string, std::string>> shown;
  for (const core::SettingsFile& file : settings.files()) {
    for (const core::SettingsEntry& entry : file.entries) {
      if (!entry.section.empty() && shown.emplace(entry.section, entry.key).second) {
        rows.push_back({entry.section, entry.key, {entry.values, file.origin, entry.place}});
      }
    }
  }
  return rows;
}

nlohmann::json to_json(const Row& row) {
  nlohmann::json value = nullptr;
  if (row.found.values.size() == 1) {
    value = row.found.values.front();
  } else if (!row.found.values.empty()) {
    value = row.found.values;
  }
  return {{"section", row.section},
          {"key", row.key},
          {"value", value},
          {"origin", core::to_string(row.found.origin)},
          {"place", row.found.place}};
}

void show_json(const core::Settings& settings) {
  nlohmann::json files = nlohmann::json::array();
  for (const core::SettingsFile& file : settings.files()) {
    files.push_back({{"path", file.path.string()},
                     {"origin", core::to_string(file.origin)},
                     {"exists", file.is_there}});
  }
  nlohmann::json list = nlohmann::json::array();
  for (const Row& row : rows_of(settings)) {
    list.push_back(to_json(row));
  }
  print_json({{"files", files}, {"settings", list}});
}

void show(const CLI::App& app, bool wants_json) {
  const core::Settings settings = core::Settings::load();
  settings.check(app);
  if (wants_json) {
    show_json(settings);
    return;
  }
  for (const core::SettingsFile& file : settings.files()) {
    if (!file.path.empty()) {
      fmt::print("{}: {}{}\n", core::to_string(file.origin), file.path.string(),
                 file.is_there ? "" : " (there is none)");
    }
  }
  fmt::print("\n");
  Table table({"SETTING", "VALUE", "FROM"});
  for (const Row& row : rows_of(settings)) {
    const std::string place = row.found.place.empty() ? "" : " (" + row.found.place + ")";
    table.add(
        {row.section.empty() ? row.key : "[" + row.section + "] " + row.key,
         row.found.values.empty() ? "-" : fmt::format("{}", fmt::join(row.found.values, ", ")),
         core::to_string(row.found.origin) + place});
  }
  fmt::print("{}", table.text());
}

}  // namespace

void add_config(CLI::App& app) {
  CLI::App* config = add_command(app, "config", kHelp);
  config->require_subcommand(1);
  auto wants_json = std::make_shared<bool>(false);
  CLI::App* command = add_command(*config, "show", kShowHelp);
  command->add_flag("--json", *wants_json, "Print one JSON value on stdout");
  command->callback([&app, wants_json] { show(app, *wants_json); });
}

}  // namespace weft::cli
