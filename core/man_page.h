#pragma once

#include <string>

#include "core/command_doc.h"

namespace weft::core {

// The source of a manual page (man macros of groff and mandoc) of a program or of one command of a
// program. `section` is 1 for what people call and 8 for services. A program with commands lists
// them, grouped; a command with commands of its own describes each.
[[nodiscard]] std::string man_page(const CommandDoc& doc, int section);

// "weft-submit": what the page of "weft submit" is called.
[[nodiscard]] std::string man_page_name(const CommandDoc& doc);

}  // namespace weft::core
