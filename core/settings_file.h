#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace weft::core {

// One line of a configuration file: `key = value`, in the section [a.b] or in none.
struct SettingsEntry {
  std::string section;              // "render", "certs issue"; empty: above all sections
  std::string key;                  // "coordinator"
  std::vector<std::string> values;  // one, but for a list
  std::string place;                // "/etc/weft/weft.toml:3"
};

// Reads a configuration file (TOML: texts, numbers, true, false, and lists of these). Throws
// core::Error: kInvalidArgument with path, line and column for what is not TOML or no such value,
// kNotFound when the file cannot be read, kResourceExhausted for more than 1 MiB.
[[nodiscard]] std::vector<SettingsEntry> read_settings_file(const std::filesystem::path& path);

}  // namespace weft::core
