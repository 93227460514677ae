#pragma once

#include <CLI/CLI.hpp>

namespace weft::cli {

// Names the application and gives it all commands of commands.h, in groups. `app` must be new.
void build_application(CLI::App& app);

}  // namespace weft::cli
