#pragma once

#include <string>

#include "core/command_doc.h"

namespace weft::core {

// What --help prints: summary, usage, text, arguments, options or commands by group, examples.
// Lines have at most 92 characters, but for examples and long words.
[[nodiscard]] std::string help_text(const CommandDoc& doc);

// "weft submit [OPTIONS] FABRIC"
[[nodiscard]] std::string usage(const CommandDoc& doc);

// The groups of `doc`'s commands, in their order.
[[nodiscard]] std::vector<std::string> groups_of(const CommandDoc& doc);

}  // namespace weft::core
