#include "core/settings_file.h"

#include <optional>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "core/error.h"
#include "core/file.h"

namespace weft::core {

namespace {

constexpr std::uint64_t kSizeLimitBytes = std::uint64_t{1} << 20;

std::optional<std::string> text_of(const toml::node& node) {
  if (const auto* text = node.as_string()) {
    return text->get();
  }
  if (const auto* number = node.as_integer()) {
    return fmt::format("{}", number->get());
  }
  if (const auto* number = node.as_floating_point()) {
    return fmt::format("{}", number->get());
  }
  if (const auto* truth = node.as_boolean()) {
    return truth->get() ? "true" : "false";
  }
  return std::nullopt;
}

class Reader {
 public:
  explicit Reader(std::string path) : path_(std::move(path)) {}

  void read(const toml::table& table, const std::string& section) {
    for (const auto& [key, value] : table) {
      const std::string name(key.str());
      if (const auto* inner = value.as_table()) {
        read(*inner, section.empty() ? name : section + " " + name);
        continue;
      }
      entries_.push_back({section, name, values_of(value, name), place_of(value)});
    }
  }

  std::vector<SettingsEntry> entries() && { return std::move(entries_); }

 private:
  [[nodiscard]] std::string place_of(const toml::node& node) const {
    return fmt::format("{}:{}", path_, node.source().begin.line);
  }

  [[nodiscard]] std::string checked_text(const toml::node& node, const std::string& key) const {
    if (const auto text = text_of(node)) {
      return *text;
    }
    throw Error(Code::kInvalidArgument,
                fmt::format("{}: {}: a value is a text in quotes, a number, true or false, or a "
                            "list of these",
                            place_of(node), key));
  }

  [[nodiscard]] std::vector<std::string> values_of(const toml::node& node,
                                                   const std::string& key) const {
    std::vector<std::string> values;
    const auto* list = node.as_array();
    if (list == nullptr) {
      return {checked_text(node, key)};
    }
    for (const toml::node& element : *list) {
      values.push_back(checked_text(element, key));
    }
    return values;
  }

  std::string path_;
  std::vector<SettingsEntry> entries_;
};

}  // namespace

std::vector<SettingsEntry> read_settings_file(const std::filesystem::path& path) {
  const std::string text = read_file(path, kSizeLimitBytes);
  try {
    Reader reader(path.string());
    reader.read(toml::parse(text, path.string()), "");
    return std::move(reader).entries();
  } catch (const toml::parse_error& error) {
    throw Error(Code::kInvalidArgument,
                fmt::format("{}:{}:{}: {}", path.string(), error.source().begin.line,
                            error.source().begin.column, error.description()));
  }
}

}  // namespace weft::core
