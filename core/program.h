#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "core/exit_code.h"

namespace weft::core {

// What the main() of every program of ours has in common.

// Also gives it --version.
void set_program_name(CLI::App& app, const std::string& name);

// --log-level; `level` holds the default, and outlives the parsing.
void add_log_option(CLI::App& app, std::string& level);
// From now on what spdlog is told goes to stderr, a line each, with time and level.
void start_log(const std::string& level);

// Parses the arguments and runs `body`, whose value is the exit code. A wrong use, a core::Error
// and any other exception end as one message on stderr and the exit code that core/exit_code.h
// says.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv,
                              const std::function<int()>& body);

}  // namespace weft::core
