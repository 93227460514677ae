#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/settings_file.h"

// Values of options that are not given on the command line. They are looked for in this order: the
// option's environment variable, the user's configuration file, the machine's, the program's own
// default. In a file, a command's section ("[render]") goes before the keys above all sections,
// which are those that several commands and programs share (kSharedSettings).

namespace weft::core {

// Name other files than ~/.config/weft/weft.toml and /etc/weft/weft.toml; empty: none is read.
inline constexpr const char* kUserFileVariable = "WEFT_CONFIG";
inline constexpr const char* kSystemFileVariable = "WEFT_SYSTEM_CONFIG";

enum class Origin { kEnvironment, kUserFile, kSystemFile, kDefault };

// "environment", "user file", "system file", "default".
[[nodiscard]] const char* to_string(Origin origin);

// A key that may stand above all sections: it sets the option --KEY of whoever has one.
struct SharedSetting {
  const char* key;
  const char* variable;  // of the environment; empty: none
  const char* default_text;
  const char* meaning;
};
[[nodiscard]] const std::vector<SharedSetting>& shared_settings();

struct SettingsFile {
  std::filesystem::path path;
  Origin origin = Origin::kUserFile;
  bool is_there = false;
  std::vector<SettingsEntry> entries;
};

// A value, and where it is from.
struct FoundSetting {
  std::vector<std::string> values;
  Origin origin = Origin::kDefault;
  std::string place;  // "WEFT_COORDINATOR", "/etc/weft/weft.toml:3"; empty for a default
};

class Settings {
 public:
  // Reads the files that there are. Throws CLI::ConfigError for what read_settings_file refuses.
  static Settings load();

  [[nodiscard]] const std::vector<SettingsFile>& files() const { return files_; }

  // What the environment or a file says of option `key` of the command `section`; nothing when
  // neither says anything.
  [[nodiscard]] std::optional<FoundSetting> find(const std::string& section, const std::string& key,
                                                 const std::string& variable) const;

  // Throws CLI::ConfigError with the place of an entry that `app` and its commands know nothing of.
  // A section of another of our programs is that program's own affair.
  void check(const CLI::App& app) const;

  // Gives the commands that were parsed what the command line did not say. An option that excludes,
  // or needs, another one yields to what the command line says. Throws CLI::ConfigError for a value
  // that the option does not take, with its place.
  void apply(CLI::App& app) const;

 private:
  void apply_to(CLI::App& command, const std::string& section) const;

  std::vector<SettingsFile> files_;
};

// While one lives, CLI11 itself does not look at the environment: it would do so for commands that
// are not called, and without saying which variable is wrong. restore() may be called before.
class EnvironmentNames {
 public:
  explicit EnvironmentNames(CLI::App& app);
  ~EnvironmentNames();
  EnvironmentNames(const EnvironmentNames&) = delete;
  EnvironmentNames& operator=(const EnvironmentNames&) = delete;
  EnvironmentNames(EnvironmentNames&&) = delete;
  EnvironmentNames& operator=(EnvironmentNames&&) = delete;

  void restore();

 private:
  void take(CLI::App& app);

  std::vector<std::pair<CLI::Option*, std::string>> names_;
};

}  // namespace weft::core
