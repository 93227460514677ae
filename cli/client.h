#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "client/coordinator.h"

namespace weft::cli {

inline constexpr const char* kDefaultCoordinator = "127.0.0.1:7411";

// Adds --coordinator ADDRESS (environment WEFT_COORDINATOR, default kDefaultCoordinator).
void add_coordinator_option(CLI::App& command, std::string& address);

using Client = client::Coordinator;
using client::new_request_id;

}  // namespace weft::cli
