#include "core/help_text.h"

#include <algorithm>
#include <sstream>

namespace weft::core {

namespace {

constexpr std::size_t kWidth = 92;
constexpr std::size_t kOptionColumn = 26;
constexpr std::size_t kCommandColumn = 14;

// `text` broken between words, every line behind `indent` spaces.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::istringstream words(text);
  std::string all;
  std::string line;
  for (std::string word; words >> word;) {
    if (!line.empty() && indent + line.size() + 1 + word.size() > kWidth) {
      all += std::string(indent, ' ') + line + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return line.empty() ? all : all + std::string(indent, ' ') + line + "\n";
}

// `left`, and `right` in a column of its own beside it, or below when `left` is too long.
std::string entry(const std::string& left, const std::string& right, std::size_t column) {
  const std::string block = wrapped(right, column);
  const std::string head = "  " + left;
  if (block.empty() || head.size() + 2 > column) {
    return head + "\n" + block;
  }
  return head + block.substr(head.size());
}

std::string joined(const std::vector<std::string>& parts, const std::string& between) {
  std::string all;
  for (const std::string& part : parts) {
    all += (all.empty() ? "" : between) + part;
  }
  return all;
}

std::string left_of(const OptionDoc& option, bool is_argument) {
  if (is_argument) {
    return option.names.front();
  }
  const bool has_short = option.names.front().size() == 2;
  return (has_short ? "" : "    ") + joined(option.names, ", ") +
         (option.value.empty() ? "" : " " + option.value);
}

std::string right_of(const OptionDoc& option, bool is_argument) {
  std::vector<std::string> remarks;
  if (!option.choices.empty()) {
    remarks.push_back("one of " + joined(option.choices, ", "));
  }
  if (!option.default_text.empty()) {
    remarks.push_back("default: " + option.default_text);
  }
  if (!option.environment.empty()) {
    remarks.push_back("or " + option.environment);
  }
  if (option.is_required && !is_argument) {
    remarks.emplace_back("required");
  }
  return option.text + (remarks.empty() ? "" : " [" + joined(remarks, "; ") + "]");
}

std::string options_text(const std::string& title, const std::vector<OptionDoc>& options,
                         bool is_argument) {
  std::string text = options.empty() ? "" : "\n" + title + ":\n";
  for (const OptionDoc& option : options) {
    text += entry(left_of(option, is_argument), right_of(option, is_argument), kOptionColumn);
  }
  return text;
}

}  // namespace

std::vector<std::string> groups_of(const CommandDoc& doc) {
  std::vector<std::string> groups;
  for (const CommandDoc& command : doc.commands) {
    if (std::find(groups.begin(), groups.end(), command.group) == groups.end()) {
      groups.push_back(command.group);
    }
  }
  return groups;
}

std::string usage(const CommandDoc& doc) {
  std::string line = doc.path;
  line += doc.commands.empty() ? "" : " COMMAND";
  line += " [OPTIONS]";
  for (const OptionDoc& argument : doc.arguments) {
    const std::string name = argument.names.front() + (argument.is_repeated ? "..." : "");
    line += argument.is_required ? " " + name : " [" + name + "]";
  }
  return line;
}

std::string help_text(const CommandDoc& doc) {
  std::string text = wrapped(doc.summary, 0) + "\nUsage: " + usage(doc) + "\n";
  for (const std::string& paragraph : doc.text) {
    text += "\n" + wrapped(paragraph, 0);
  }
  for (const std::string& group : groups_of(doc)) {
    text += "\n" + group + ":\n";
    for (const CommandDoc& command : doc.commands) {
      text += command.group == group ? entry(command.name, command.summary, kCommandColumn) : "";
    }
  }
  text += options_text("Arguments", doc.arguments, true);
  text += options_text("Options", doc.options, false);
  if (!doc.examples.empty()) {
    text += doc.examples.size() == 1 ? "\nExample:\n" : "\nExamples:\n";
    for (const std::string& example : doc.examples) {
      text += "  " + example + "\n";
    }
  }
  return text;
}

}  // namespace weft::core
