#include "cli/client.h"

#include "proto/address.h"

namespace weft::cli {

void add_coordinator_option(CLI::App& command, std::string& address) {
  address = kDefaultCoordinator;
  command
      .add_option("--coordinator", address, "Address of the coordinator: host:port or unix:/path")
      ->envname("WEFT_COORDINATOR")
      ->check(CLI::Validator(v1::mistake_in_address, "", "address"))
      ->capture_default_str();
}

}  // namespace weft::cli
