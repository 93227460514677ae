#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace weft::core {

// One argument or option of a command, as people are told of it.
struct OptionDoc {
  std::vector<std::string> names;    // "-o", "--output"; of an argument the one name, "FABRIC"
  std::string value;                 // what stands for its value, "FILE"; empty: it takes none
  std::string text;                  // one paragraph
  std::string default_text;          // empty: there is none, or `text` says it
  std::string environment;           // the variable that sets it; empty: none
  std::vector<std::string> choices;  // all values that it takes; empty: others, too
  bool is_required = false;
  bool is_repeated = false;
  bool is_number = false;

  // Whether `name` is one of its names.
  [[nodiscard]] bool is_called(const std::string& name) const;
};

// What there is to say of a program or of one of its commands. Help, manual pages and completion
// are all written from this.
struct CommandDoc {
  std::string name;                   // "submit"
  std::string path;                   // "weft submit"
  std::string group;                  // under which it stands in the list of commands
  std::string summary;                // one line
  std::vector<std::string> text;      // further paragraphs
  std::vector<std::string> examples;  // one command line each
  std::vector<OptionDoc> arguments;   // in their order
  std::vector<OptionDoc> options;     // --help is among them
  std::vector<CommandDoc> commands;

  // The command of that name; null when there is none.
  [[nodiscard]] const CommandDoc* find(const std::string& command) const;
};

// Describes `app` and its commands. A command's description is its summary; its footer holds
// paragraphs, and at its end "Example: " or "Examples:" with command lines. What belongs to the
// group "" is hidden.
[[nodiscard]] CommandDoc describe(const CLI::App& app);

}  // namespace weft::core
