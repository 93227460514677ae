#include "core/command_doc.h"

#include <algorithm>
#include <cctype>
#include <sstream>

namespace weft::core {

namespace {

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string trimmed(const std::string& line) {
  const std::size_t first = line.find_first_not_of(" \t");
  return first == std::string::npos ? ""
                                    : line.substr(first, line.find_last_not_of(" \t") - first + 1);
}

// Lines that were broken to fit a source file become one.
std::string unbroken(const std::string& text) {
  std::istringstream lines(text);
  std::string joined;
  for (std::string line; std::getline(lines, line);) {
    const std::string part = trimmed(line);
    joined += joined.empty() || part.empty() ? part : " " + part;
  }
  return joined;
}

// CLI11 writes the choices of CLI::IsMember behind the type: "TEXT:{preview,paper,best}".
std::vector<std::string> choices_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t open = type.find(":{");
  const std::size_t close = type.find('}', open);
  std::vector<std::string> choices;
  if (open == std::string::npos || close == std::string::npos) {
    return choices;
  }
  std::istringstream list(type.substr(open + 2, close - open - 2));
  for (std::string choice; std::getline(list, choice, ',');) {
    choices.push_back(choice);
  }
  return choices;
}

bool is_number(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.starts_with("INT") || type.starts_with("UINT") || type.starts_with("FLOAT");
}

// What stands for the value of an option: its last word, "--tls-folder FOLDER".
std::string value_name(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) {
    return "";
  }
  if (!option.get_option_text().empty()) {
    return option.get_option_text();
  }
  if (is_number(option)) {
    return "NUMBER";
  }
  const std::string name =
      option.get_lnames().empty() ? option.get_snames().front() : option.get_lnames().front();
  const std::string word = name.substr(name.rfind('-') + 1);
  if (word == "out" || word == "output" || word == "png") {
    return "FILE";
  }
  return word == "coordinator" || word == "node" || word == "listen" ? "ADDRESS" : upper(word);
}

OptionDoc describe(const CLI::Option& option) {
  OptionDoc doc;
  doc.text = unbroken(option.get_description());
  doc.default_text = option.get_default_str();
  doc.environment = option.get_envname();
  doc.choices = choices_of(option);
  doc.is_required = option.get_required();
  doc.is_repeated = option.get_expected_max() == CLI::detail::expected_max_vector_size;
  doc.is_number = is_number(option);
  if (option.get_positional()) {
    doc.value = upper(option.get_name(true, false));
    doc.names = {doc.value};
    return doc;
  }
  for (const std::string& name : option.get_snames()) {
    doc.names.push_back("-" + name);
  }
  // Further ones are names that it had once: they are understood, and not told of.
  if (!option.get_lnames().empty()) {
    doc.names.push_back("--" + option.get_lnames().front());
  }
  doc.value = value_name(option);
  return doc;
}

// The end of a command line that its footer goes on with in the next line is not known of: examples
// are one line each.
void read_footer(const std::string& footer, CommandDoc& doc) {
  std::istringstream lines(footer);
  std::string paragraph;
  bool is_example = false;
  const auto end_paragraph = [&] {
    if (!paragraph.empty()) {
      doc.text.push_back(paragraph);
      paragraph.clear();
    }
  };
  for (std::string line; std::getline(lines, line);) {
    std::string text = trimmed(line);
    for (const std::string head : {"Examples:", "Example:"}) {
      if (text.starts_with(head)) {
        is_example = true;
        text = trimmed(text.substr(head.size()));
      }
    }
    if (text.empty()) {
      end_paragraph();
    } else if (is_example) {
      doc.examples.push_back(text);
    } else {
      paragraph += (paragraph.empty() ? "" : " ") + text;
    }
  }
  end_paragraph();
}

CommandDoc describe(const CLI::App& app, const std::string& above) {
  CommandDoc doc;
  doc.name = app.get_name();
  doc.path = above.empty() ? doc.name : above + " " + doc.name;
  doc.group = app.get_group();
  doc.summary = unbroken(app.get_description());
  // CLI11 hands a footer down to commands that have none.
  if (app.get_parent() == nullptr || app.get_footer() != app.get_parent()->get_footer()) {
    read_footer(app.get_footer(), doc);
  }
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) {
      (option->get_positional() ? doc.arguments : doc.options).push_back(describe(*option));
    }
  }
  // What every command has stands last.
  const auto is_common = [](const OptionDoc& option) {
    return option.is_called("--help") || option.is_called("--version");
  };
  std::stable_partition(doc.options.begin(), doc.options.end(),
                        [&](const OptionDoc& option) { return !is_common(option); });
  for (const CLI::App* command : app.get_subcommands([](const CLI::App* sub) {
         return !sub->get_name().empty() && !sub->get_group().empty();
       })) {
    doc.commands.push_back(describe(*command, doc.path));
  }
  return doc;
}

}  // namespace

bool OptionDoc::is_called(const std::string& name) const {
  return std::find(names.begin(), names.end(), name) != names.end();
}

const CommandDoc* CommandDoc::find(const std::string& command) const {
  const auto found = std::find_if(commands.begin(), commands.end(),
                                  [&](const CommandDoc& doc) { return doc.name == command; });
  return found == commands.end() ? nullptr : &*found;
}

CommandDoc describe(const CLI::App& app) {
  std::string above;
  for (const CLI::App* parent = app.get_parent(); parent != nullptr;
       parent = parent->get_parent()) {
    above = parent->get_name() + (above.empty() ? "" : " ") + above;
  }
  return describe(app, above);
}

}  // namespace weft::core
