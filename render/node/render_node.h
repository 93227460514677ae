#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "render/node/render_service.h"
#include "security/server_gate.h"

namespace weft::render {

// A render node: RenderService, the health service (grpc.health.v1) and server reflection on one
// address.
class RenderNode {
 public:
  // `listen` is HOST:PORT (port 0: any free one) or unix:PATH. Throws what security::ServerGate
  // throws, and core::Error(kUnavailable) when the address cannot be had.
  RenderNode(const RenderNodeOptions& options, const security::Endpoint& listen);
  // Ends what is being drawn.
  ~RenderNode();
  RenderNode(const RenderNode&) = delete;
  RenderNode& operator=(const RenderNode&) = delete;
  RenderNode(RenderNode&&) = delete;
  RenderNode& operator=(RenderNode&&) = delete;

  // What callers connect to: HOST:PORT with the port that is in use, or unix:PATH.
  [[nodiscard]] const std::string& address() const { return address_; }

  // Takes no more orders, says so to those who ask for its health, and returns when the ones it has
  // are drawn; or when `should_hurry`, asked now and then, says so.
  void drain(const std::function<bool()>& should_hurry);

 private:
  RenderService service_;
  std::unique_ptr<security::ServerGate> gate_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

}  // namespace weft::render
