#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include "proto/weft/v1/render.grpc.pb.h"
#include "security/endpoint.h"

namespace weft::coordinator {

// Pictures that people wait for and that are ordered of the render node at the same time; it draws
// one after the other.
inline constexpr std::size_t kOrdersAtOnce = 3;
// Of floats, and as many again while they are put together.
inline constexpr std::uint32_t kPictureSideLimit = 640;

// Has a render node draw. Any thread.
class Painter {
 public:
  // An empty address: there is no render node. Throws what security::open_channel throws.
  explicit Painter(const security::Endpoint& node);

  [[nodiscard]] bool has_node() const { return stub_ != nullptr; }
  [[nodiscard]] const std::string& address() const { return address_; }

  struct Painting {
    std::vector<float> rgb;  // linear, three a pixel, row by row from the top
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    double draw_seconds = 0;
    std::string device;
  };
  // One picture of the scene. Throws core::Error: kFailedPrecondition when there is no node,
  // kResourceExhausted when kOrdersAtOnce are being drawn for us, kUnavailable when the node is
  // away or does not draw in time or stop() was called, kCancelled when a later call came from the
  // same viewer (a name that each browser chooses; empty: none), else as render.proto says.
  [[nodiscard]] Painting paint(const v1::Scene& scene, std::chrono::milliseconds in_time,
                               const std::string& viewer);

  // The same for a picture that makes way: it is ordered when no other is on its way, given up when
  // somebody wants one, and ordered again. Throws as paint(), and kUnavailable when it has not come
  // `in_time`.
  [[nodiscard]] Painting paint_at_leisure(const v1::Scene& scene,
                                          std::chrono::milliseconds in_time);

  // Errors as paint().
  [[nodiscard]] v1::GetNodeResponse node();

  // Ends what is being drawn, and draws no more.
  void stop();

 private:
  // A call that stop() reaches.
  class Order;
  struct Wish {
    std::chrono::milliseconds in_time;
    std::string viewer;
    bool makes_way = false;
  };
  // Nothing when it made way.
  [[nodiscard]] std::optional<Painting> order(const v1::Scene& scene, const Wish& wish);

  std::string address_;
  std::shared_ptr<grpc::Channel> channel_;  // shared: gRPC's stub asks for it
  std::unique_ptr<v1::RenderService::Stub> stub_;
  std::mutex mutex_;  // guards all below
  std::condition_variable fewer_;
  std::map<grpc::ClientContext*, Wish> orders_;  // without cancelled ones
  bool is_stopped_ = false;
};

}  // namespace weft::coordinator
