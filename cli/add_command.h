#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace weft::cli {

// Adds a command whose help is `help`: its first line stands in the list of commands, the rest
// below the command's flags.
inline CLI::App* add_command(CLI::App& app, const std::string& name, const std::string& help) {
  const std::size_t end = help.find('\n');
  CLI::App* command = app.add_subcommand(name, help.substr(0, end));
  command->group("Commands");
  if (end != std::string::npos) {
    command->footer(help.substr(end + 1));
  }
  return command;
}

}  // namespace weft::cli
