#pragma once

#include <memory>
#include <string>

#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include "security/endpoint.h"

namespace weft::security {

// Builds a server, and stands between its services and those who call. The server also has the
// health service (grpc.health.v1) and reflection, for everyone who has a role.
//
// With a TLS folder, a connection needs
// a certificate that the folder's authority signed; each call, of any service that the server has,
// needs one that has neither expired nor been revoked, whose role allows the call; and what runs
// for a caller whose certificate is revoked or expires is cancelled within seconds. New
// certificates and lists in the folder are used without a restart: for connections from then on,
// calls at once. Without a TLS folder everyone who reaches the address may do everything.
class ServerGate {
 public:
  // `listen` is HOST:PORT (port 0: any free one) or unix:PATH. Throws
  // core::Error(kPermissionDenied) when other machines reach the address and neither a TLS folder
  // nor `insecure` is there, and what check_tls_folder throws. Must outlive the server.
  explicit ServerGate(const Endpoint& listen);
  ~ServerGate();
  ServerGate(const ServerGate&) = delete;
  ServerGate& operator=(const ServerGate&) = delete;
  ServerGate(ServerGate&&) = delete;
  ServerGate& operator=(ServerGate&&) = delete;

  // For services and what else the server needs; limits and keepalive are there already.
  [[nodiscard]] grpc::ServerBuilder& builder() { return *builder_; }
  // Starts the server, once. Its health is that it serves. Throws core::Error(kUnavailable) when
  // the address cannot be had.
  [[nodiscard]] std::unique_ptr<grpc::Server> start();
  // Where the server listens once it is started: with the port that is in use.
  [[nodiscard]] std::string address() const;

 private:
  class Guard;
  class Processor;
  class Watch;

  void secure(const std::string& folder);

  std::unique_ptr<grpc::ServerBuilder> builder_;
  std::string listen_;
  int port_ = 0;
  std::shared_ptr<Guard> guard_;  // shared with gRPC's credentials; empty without TLS
};

}  // namespace weft::security
