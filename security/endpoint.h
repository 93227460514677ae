#pragma once

#include <string>
#include <utility>

namespace weft::security {

// Where a service is, or shall be, and how one talks there.
struct Endpoint {
  // An address alone is a local one: implicit, because that is the common case.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Endpoint(std::string where = "") : address(std::move(where)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Endpoint(const char* where) : address(where) {}
  Endpoint(std::string where, std::string folder, bool may_be_insecure)
      : address(std::move(where)), tls_folder(std::move(folder)), insecure(may_be_insecure) {}

  std::string address;     // host:port, or unix:/path
  std::string tls_folder;  // as `weft certs issue` writes it; empty: TLS is not spoken
  bool insecure = false;   // without TLS an address that other machines reach is taken too
};

}  // namespace weft::security
