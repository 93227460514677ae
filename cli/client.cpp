#include "cli/client.h"

#include "proto/address.h"
#include "security/endpoint_options.h"

namespace weft::cli {

void add_coordinator_option(CLI::App& command, security::Endpoint& coordinator) {
  coordinator.address = kDefaultCoordinator;
  command
      .add_option("--coordinator", coordinator.address,
                  "Address of the coordinator: host:port or unix:/path")
      ->envname("WEFT_COORDINATOR")
      ->check(CLI::Validator(v1::mistake_in_address, "", "address"))
      ->capture_default_str();
  security::add_security_options(command, coordinator);
}

}  // namespace weft::cli
