#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "client/coordinator.h"
#include "security/endpoint.h"

namespace weft::cli {

inline constexpr const char* kDefaultCoordinator = "127.0.0.1:7411";

// Adds --coordinator ADDRESS (environment WEFT_COORDINATOR, default kDefaultCoordinator), and how
// to talk to it: --tls-folder and --insecure.
void add_coordinator_option(CLI::App& command, security::Endpoint& coordinator);

using Client = client::Coordinator;
using client::new_request_id;

}  // namespace weft::cli
