#pragma once

#include <CLI/CLI.hpp>

#include "core/completion.h"

namespace weft::cli {

// For completion: ids of jobs, names of workers, fabrics and versions, asked of the coordinator
// that the command line, the environment or the configuration names. It gets 400 ms; when it does
// not answer there are no such words, and nothing is said. `app` must outlive the result.
[[nodiscard]] core::CompletionSource known_names(const CLI::App& app);

}  // namespace weft::cli
