#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "core/completion.h"
#include "core/exit_code.h"

namespace weft::core {

// What the main() of every program of ours has in common.

// Also gives it --version, and its help the form of core/help_text.h: call it before commands are
// added.
void set_program_name(CLI::App& app, const std::string& name);

// --log-level; `level` holds the default, and outlives the parsing.
void add_log_option(CLI::App& app, std::string& level);
// From now on what spdlog is told goes to stderr, a line each, with time and level.
void start_log(const std::string& level);

// Parses the arguments, completes them from the environment and the configuration files
// (core/settings.h) and runs `body`, whose value is the exit code. A wrong use, a core::Error and
// any other exception end as one message on stderr and the exit code that core/exit_code.h says.
// `PROGRAM __complete WORDS` prints what may stand in place of the last word (core/completion.h),
// with `source` for names, and `PROGRAM __man` the source of its manual page.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv,
                              const std::function<int()>& body,
                              const CompletionSource& source = {});

}  // namespace weft::core
