#pragma once

#include <memory>
#include <string>

#include "coordinator/scheduler/scheduler.h"
#include "security/endpoint.h"

namespace weft::coordinator {

// The coordinator's services on one address.
class Server {
 public:
  // `listen` is HOST:PORT (port 0: any free one) or unix:PATH. Throws what security::ServerGate
  // throws, and core::Error(kUnavailable) when the address cannot be had. `scheduler` must outlive
  // the server.
  Server(Scheduler& scheduler, const security::Endpoint& listen);
  // Stops as stop() does.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  Server(Server&&) = delete;
  Server& operator=(Server&&) = delete;

  // What clients connect to: HOST:PORT with the port that is in use, or unix:PATH.
  [[nodiscard]] const std::string& address() const { return address_; }

  // Ends what is being answered (callers get UNAVAILABLE) and takes no more calls.
  void stop();

 private:
  struct Services;
  std::unique_ptr<Services> services_;
  std::string address_;
};

}  // namespace weft::coordinator
