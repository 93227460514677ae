#pragma once

#include <memory>
#include <string>

#include <grpcpp/server_builder.h>

#include "security/endpoint.h"

namespace weft::security {

// What stands between a server's services and those who call. With a TLS folder, a connection needs
// a certificate that the folder's authority signed; each call, of any service that the server has,
// needs one that has neither expired nor been revoked, whose role allows the call; and what runs
// for a caller whose certificate is revoked or expires is cancelled within seconds. New
// certificates and lists in the folder are used without a restart: for connections from then on,
// calls at once. Without a TLS folder everyone who reaches the address may do everything.
class ServerGate {
 public:
  // Adds the address of `listen` (port 0: any free one; `port` has it when the server is built) and
  // what the server needs to the builder. Throws core::Error(kPermissionDenied) when other machines
  // reach the address and neither a TLS folder nor `insecure` is there, and what check_tls_folder
  // throws. Must outlive the server.
  ServerGate(grpc::ServerBuilder& builder, const Endpoint& listen);
  ~ServerGate();
  ServerGate(const ServerGate&) = delete;
  ServerGate& operator=(const ServerGate&) = delete;
  ServerGate(ServerGate&&) = delete;
  ServerGate& operator=(ServerGate&&) = delete;

  // Where the server listens once it is built: the address with the port that is in use. Throws
  // core::Error(kUnavailable) when the address could not be had.
  [[nodiscard]] std::string address() const;

 private:
  class Guard;
  class Processor;
  class Watch;

  std::string listen_;
  int port_ = 0;
  std::shared_ptr<Guard> guard_;  // shared with gRPC's credentials; empty without TLS
};

}  // namespace weft::security
