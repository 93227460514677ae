#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "proto/weft/v1/render.grpc.pb.h"
#include "render/gpu/device_renderer.h"
#include "render/node/fabric_store.h"
#include "render/node/render_queue.h"
#include "security/endpoint.h"

namespace weft::render {

struct RenderNodeOptions {
  security::Endpoint coordinator;
  std::filesystem::path cache;  // folder of fetched fabrics and fitted environments
  std::uint64_t cache_limit_bytes = std::uint64_t{16} << 30;
  std::uint64_t memory_limit_bytes = std::uint64_t{4} << 30;
  std::uint32_t orders_limit = 8;  // being drawn and waiting
  std::string device = "auto";     // as gpu::open_renderer takes it
  unsigned threads = 0;            // 0: as many as the machine has
};

// RenderService as render.proto has it. Any thread may call.
class RenderService final : public v1::RenderService::Service {
 public:
  // Opens the device. Throws what gpu::open_renderer throws.
  explicit RenderService(const RenderNodeOptions& options);

  grpc::Status Render(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::RenderResponse, v1::RenderRequest>* stream) override;
  grpc::Status GetNode(grpc::ServerContext* context, const v1::GetNodeRequest* request,
                       v1::GetNodeResponse* response) override;

  // Takes no more orders; those it has go on.
  void drain() { queue_.close(); }
  // Ends the orders it has.
  void abort() { aborted_ = true; }
  [[nodiscard]] std::uint32_t orders() const { return queue_.size(); }

 private:
  class Conversation;
  void draw(const v1::RenderOrder& order, Conversation& conversation);

  RenderNodeOptions options_;
  RenderQueue queue_;
  FabricStore fabrics_;
  // Keeps what it has of fabrics between orders; null: the CPU draws. Of the order that is drawn.
  std::unique_ptr<gpu::DeviceRenderer> device_;
  std::string device_name_ = "cpu";
  std::atomic<bool> aborted_ = false;
};

}  // namespace weft::render
