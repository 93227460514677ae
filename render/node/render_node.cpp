#include "render/node/render_node.h"

#include <thread>

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>

#include "core/error.h"
#include "proto/address.h"
#include "proto/limits.h"

namespace weft::render {
namespace {

constexpr int kThreadsLimit = 128;  // each order holds one, waiting or not
constexpr auto kGrace = std::chrono::seconds(2);
constexpr std::chrono::milliseconds kBetweenQuestions{50};
// A caller whose machine is gone is noticed after these.
constexpr int kKeepaliveMs = 20'000;
constexpr int kKeepaliveTimeoutMs = 10'000;
constexpr int kFastestPingMs = 10'000;  // that a caller may send

void set_keepalive(grpc::ServerBuilder& builder) {
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kFastestPingMs);
}

}  // namespace

RenderNode::RenderNode(const RenderNodeOptions& options, const std::string& listen, bool insecure)
    : service_(options), address_(listen) {
  if (!insecure && !v1::is_local_address(listen)) {
    throw core::Error(core::Code::kPermissionDenied,
                      listen +
                          " can be reached from other machines, and calls are neither "
                          "encrypted nor checked; listen on 127.0.0.1:PORT or unix:PATH, or "
                          "say --insecure in a network that you trust");
  }
  grpc::EnableDefaultHealthCheckService(true);
  static const bool has_reflection = [] {
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  static_cast<void>(has_reflection);
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(listen, grpc::InsecureServerCredentials(), &port);
  // Two nodes must not share a port.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.SetMaxReceiveMessageSize(v1::kMessageLimitBytes);
  builder.SetMaxSendMessageSize(v1::kMessageLimitBytes);
  set_keepalive(builder);
  grpc::ResourceQuota quota("render node");
  quota.SetMaxThreads(kThreadsLimit);
  builder.SetResourceQuota(quota);
  builder.RegisterService(&service_);
  server_ = builder.BuildAndStart();
  if (server_ == nullptr || port == 0) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot listen on " + listen +
                          "; is it written HOST:PORT or unix:PATH, and is another program using "
                          "it?");
  }
  server_->GetHealthCheckService()->SetServingStatus("weft.v1.RenderService", true);
  if (!listen.starts_with("unix:")) {
    address_ = listen.substr(0, listen.rfind(':') + 1) + std::to_string(port);
  }
}

RenderNode::~RenderNode() {
  service_.drain();
  service_.abort();
  server_->Shutdown(std::chrono::system_clock::now() + kGrace);
  server_->Wait();
}

void RenderNode::drain(const std::function<bool()>& should_hurry) {
  service_.drain();
  server_->GetHealthCheckService()->SetServingStatus(false);
  while (service_.orders() > 0 && !should_hurry()) {
    std::this_thread::sleep_for(kBetweenQuestions);
  }
}

}  // namespace weft::render
