#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::cli {

// Adds --quality preview|paper|best, which overrides the description's own.
void add_quality_option(CLI::App& command, std::string& quality);

// The value that the option took; unspecified when empty. REQUIRES: it passed the option's check.
[[nodiscard]] v1::Quality parse_quality(const std::string& quality);

}  // namespace weft::cli
