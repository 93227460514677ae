#include "proto/address.h"

namespace weft::v1 {

std::string mistake_in_address(const std::string& address) {
  const auto mistake = [&](const std::string& what) {
    return "'" + address + "' is not an address: " + what +
           "; write host:port, like 127.0.0.1:7411, or unix:/path";
  };
  if (address.rfind("unix:", 0) == 0) {
    return address.size() > 5 ? std::string() : mistake("no path follows unix:");
  }
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) {
    return mistake("it has no port");
  }
  const std::string port = address.substr(colon + 1);
  if (port.empty() || port.size() > 5 ||
      port.find_first_not_of("0123456789") != std::string::npos || std::stoul(port) < 1 ||
      std::stoul(port) > 65535) {
    return mistake("its port is not a number from 1 to 65535");
  }
  return "";
}

bool is_local_address(const std::string& address) {
  return address.starts_with("unix:") || address.starts_with("127.") ||
         address.starts_with("localhost:") || address.starts_with("[::1]:");
}

}  // namespace weft::v1
