#include "core/settings.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include "core/error.h"
#include "core/mistakes.h"

namespace weft::core {

namespace {

constexpr std::array<const char*, 4> kPrograms{"weft", "weft-coordinator", "weft-worker",
                                               "weft-render"};

std::optional<std::string> variable_value(const char* name) {
  // No other thread changes the environment: weft does so before it starts the first.
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe)
  return value == nullptr ? std::nullopt : std::optional<std::string>(value);
}

// $XDG_CONFIG_HOME/weft/weft.toml, else ~/.config/weft/weft.toml; empty when neither is set.
std::filesystem::path users_file() {
  const std::string config = variable_value("XDG_CONFIG_HOME").value_or("");
  if (config.starts_with('/')) {
    return std::filesystem::path(config) / "weft" / "weft.toml";
  }
  const std::string home = variable_value("HOME").value_or("");
  return home.empty() ? std::filesystem::path()
                      : std::filesystem::path(home) / ".config" / "weft" / "weft.toml";
}

SettingsFile load_file(const std::filesystem::path& path, Origin origin) {
  SettingsFile file{path, origin, false, {}};
  if (path.empty()) {
    return file;
  }
  try {
    file.entries = read_settings_file(path);
    file.is_there = true;
  } catch (const Error& error) {
    std::error_code failure;
    if (error.code() != Code::kNotFound || std::filesystem::exists(path, failure)) {
      throw CLI::ConfigError(error.what());
    }
  }
  return file;
}

const SettingsEntry* find_entry(const SettingsFile& file, const std::string& section,
                                const std::string& key) {
  const auto found = std::find_if(
      file.entries.begin(), file.entries.end(),
      [&](const SettingsEntry& entry) { return entry.section == section && entry.key == key; });
  return found == file.entries.end() ? nullptr : &*found;
}

bool is_shared(const std::string& key) {
  const auto& shared = shared_settings();
  return std::any_of(shared.begin(), shared.end(),
                     [&](const SharedSetting& setting) { return setting.key == key; });
}

// --help ends a program; it is no setting.
bool is_settable(const CLI::Option& option) {
  return !option.get_lnames().empty() && !option.get_group().empty() &&
         option.get_lnames().front() != "help" && option.get_lnames().front() != "version";
}

std::vector<std::string> keys_of(const CLI::App& command) {
  std::vector<std::string> keys;
  for (const CLI::Option* option : command.get_options()) {
    if (is_settable(*option)) {
      keys.push_back(option->get_lnames().front());
    }
  }
  return keys;
}

// The command that a section is about; null when there is none. A service's section has its name.
const CLI::App* command_of(const CLI::App& app, const std::string& section) {
  if (section == app.get_name() && app.get_subcommands({}).empty()) {
    return &app;
  }
  const CLI::App* command = &app;
  for (const std::string& name : CLI::detail::split(section, ' ')) {
    const auto found = command->get_subcommands(
        [&](const CLI::App* sub) { return sub->get_name() == name && !sub->get_group().empty(); });
    if (found.empty()) {
      return nullptr;
    }
    command = found.front();
  }
  return command;
}

void check_entry(const CLI::App& app, const SettingsEntry& entry) {
  if (entry.section.empty()) {
    if (!is_shared(entry.key)) {
      std::vector<std::string> known;
      for (const SharedSetting& setting : shared_settings()) {
        known.emplace_back(setting.key);
      }
      throw CLI::ConfigError(entry.place + ": there is no setting " + in_quotes(entry.key) +
                             " for all commands" + suggestion(entry.key, known) +
                             "; one command's settings stand below [COMMAND]");
    }
    return;
  }
  const CLI::App* command = command_of(app, entry.section);
  const bool is_program =
      std::find(kPrograms.begin(), kPrograms.end(), entry.section) != kPrograms.end();
  const bool is_service = app.get_subcommands({}).empty();
  if (command == nullptr && (is_program || is_service)) {
    return;  // another program's
  }
  if (command == nullptr) {
    std::vector<std::string> known(kPrograms.begin() + 1, kPrograms.end());
    for (const CLI::App* sub : app.get_subcommands({})) {
      known.push_back(sub->get_name());
    }
    throw CLI::ConfigError(entry.place + ": [" + entry.section + "] is no command" +
                           suggestion(entry.section, known));
  }
  const std::vector<std::string> keys = keys_of(*command);
  if (std::find(keys.begin(), keys.end(), entry.key) == keys.end()) {
    throw CLI::ConfigError(entry.place + ": " + entry.section + " has no setting " +
                           in_quotes(entry.key) + suggestion(entry.key, keys));
  }
}

// Whether the options that are given leave room for this one.
bool is_free(const CLI::Option& option) {
  const auto is_given = [](const CLI::Option* other) { return other->count() > 0; };
  const auto excludes = option.get_excludes();
  const auto needs = option.get_needs();
  return std::none_of(excludes.begin(), excludes.end(), is_given) &&
         std::all_of(needs.begin(), needs.end(), is_given);
}

void set_option(CLI::Option& option, const FoundSetting& found) {
  try {
    for (const std::string& value : found.values) {
      option.add_result(value);
    }
    option.run_callback();
  } catch (const CLI::ParseError& error) {
    option.clear();
    throw CLI::ConfigError(found.place + ": " + error.what());
  }
}

}  // namespace

const char* to_string(Origin origin) {
  switch (origin) {
    case Origin::kEnvironment:
      return "environment";
    case Origin::kUserFile:
      return "user file";
    case Origin::kSystemFile:
      return "system file";
    case Origin::kDefault:
      return "default";
  }
  return "";
}

const std::vector<SharedSetting>& shared_settings() {
  static const std::vector<SharedSetting> settings{
      {"coordinator", "WEFT_COORDINATOR", "127.0.0.1:7411", "address of the coordinator"},
      {"tls-folder", "WEFT_TLS_FOLDER", "", "certificate and key, from 'weft certs issue'"},
      {"insecure", "", "false", "talk to other machines without TLS"},
      {"node", "WEFT_RENDER_NODE", "", "address of the render node that draws"},
      {"user", "WEFT_USER", "", "who jobs are for, in the cluster's shares"},
      {"quality", "", "", "preview, paper or best, whatever a description says"},
      {"device", "", "auto", "what draws: auto, cpu, or a device of 'weft render --list-devices'"}};
  return settings;
}

Settings Settings::load() {
  const auto user = variable_value(kUserFileVariable);
  const auto system = variable_value(kSystemFileVariable);
  Settings settings;
  settings.files_.push_back(
      load_file(user ? std::filesystem::path(*user) : users_file(), Origin::kUserFile));
  settings.files_.push_back(
      load_file(system ? *system : "/etc/weft/weft.toml", Origin::kSystemFile));
  return settings;
}

std::optional<FoundSetting> Settings::find(const std::string& section, const std::string& key,
                                           const std::string& variable) const {
  if (!variable.empty()) {
    const auto value = variable_value(variable.c_str());
    if (value && !value->empty()) {
      return FoundSetting{{*value}, Origin::kEnvironment, variable};
    }
  }
  for (const SettingsFile& file : files_) {
    const SettingsEntry* entry = section.empty() ? nullptr : find_entry(file, section, key);
    if (entry == nullptr && is_shared(key)) {
      entry = find_entry(file, "", key);
    }
    if (entry != nullptr) {
      return FoundSetting{entry->values, file.origin, entry->place};
    }
  }
  return std::nullopt;
}

void Settings::check(const CLI::App& app) const {
  for (const SettingsFile& file : files_) {
    for (const SettingsEntry& entry : file.entries) {
      check_entry(app, entry);
    }
  }
}

void Settings::apply(CLI::App& app) const {
  check(app);
  apply_to(app, app.get_subcommands({}).empty() ? app.get_name() : "");
}

void Settings::apply_to(CLI::App& command, const std::string& section) const {
  for (CLI::Option* option : command.get_options([](CLI::Option* o) { return is_settable(*o); })) {
    if (option->count() > 0 || !is_free(*option)) {
      continue;
    }
    const auto found = find(section, option->get_lnames().front(), option->get_envname());
    if (found) {
      set_option(*option, *found);
    }
  }
  for (CLI::App* sub : command.get_subcommands()) {
    apply_to(*sub, section.empty() ? sub->get_name() : section + " " + sub->get_name());
  }
}

EnvironmentNames::EnvironmentNames(CLI::App& app) { take(app); }

EnvironmentNames::~EnvironmentNames() { restore(); }

void EnvironmentNames::take(CLI::App& app) {
  for (CLI::Option* option : app.get_options([](CLI::Option*) { return true; })) {
    if (!option->get_envname().empty()) {
      names_.emplace_back(option, option->get_envname());
      option->envname("");
    }
  }
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    take(*command);
  }
}

void EnvironmentNames::restore() {
  for (const auto& [option, name] : names_) {
    option->envname(name);
  }
  names_.clear();
}

}  // namespace weft::core
