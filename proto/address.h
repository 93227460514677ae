#pragma once

#include <string>

namespace weft::v1 {

// What is wrong with `address` as one to connect to; empty when nothing is. Right are host:port,
// with a port of 1 to 65535, and unix:/path. gRPC itself would take more and say less.
[[nodiscard]] std::string mistake_in_address(const std::string& address);

// Whether what listens at `address` can be reached from this machine alone: a Unix socket or a
// loopback address.
[[nodiscard]] bool is_local_address(const std::string& address);

}  // namespace weft::v1
