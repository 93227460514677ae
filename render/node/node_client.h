#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include <grpcpp/channel.h>

#include "proto/weft/v1/render.grpc.pb.h"
#include "render/draw_pictures.h"
#include "security/endpoint.h"

namespace weft::render {

// What a node says while an order is not drawn yet. Any may be empty.
struct NodeReports {
  std::function<void(std::uint32_t ahead)> queued;
  std::function<void(const v1::RenderFetching&)> fetching;
};

// A connection to a render node, made when it is first used. One thread.
class NodeClient {
 public:
  // Throws what security::open_channel throws.
  explicit NodeClient(security::Endpoint endpoint);

  // draw_pictures, but on the node: the same calls of `sink`, the same pictures. The files that the
  // scene names are read by `files` and sent along; what sink.start returns is not asked. Throws
  // core::Error as render.proto has it, kUnavailable when no node answers.
  void draw_pictures(const v1::Scene& scene, bool progressive, const FileSource& files,
                     PictureSink& sink, const NodeReports& reports,
                     const std::function<bool()>& should_stop);

  // The fabrics of the frame that was started last, by reference.
  [[nodiscard]] const std::map<std::string, v1::RenderedFabric>& fabrics() const {
    return fabrics_;
  }

  [[nodiscard]] v1::GetNodeResponse node();

 private:
  class Reception;
  [[nodiscard]] std::string explained(const grpc::Status& status) const;

  security::Endpoint endpoint_;
  std::shared_ptr<grpc::Channel> channel_;  // shared: gRPC's stub asks for it
  std::unique_ptr<v1::RenderService::Stub> stub_;
  std::map<std::string, v1::RenderedFabric> fabrics_;
};

}  // namespace weft::render
