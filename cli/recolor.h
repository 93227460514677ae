#pragma once

#include <CLI/CLI.hpp>

namespace weft::cli {

// recolor: the same cloth in other colours. As the commands of cli/commands.h.
void add_recolor(CLI::App& app);

}  // namespace weft::cli
