#include "render/node/render_node.h"

#include <thread>

#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>

namespace weft::render {
namespace {

constexpr int kThreadsLimit = 128;  // each order holds one, waiting or not
constexpr auto kGrace = std::chrono::seconds(2);
constexpr std::chrono::milliseconds kBetweenQuestions{50};

}  // namespace

RenderNode::RenderNode(const RenderNodeOptions& options, const security::Endpoint& listen)
    : service_(options), gate_(std::make_unique<security::ServerGate>(listen)) {
  grpc::ResourceQuota quota("render node");
  quota.SetMaxThreads(kThreadsLimit);
  gate_->builder().SetResourceQuota(quota);
  gate_->builder().RegisterService(&service_);
  server_ = gate_->start();
  address_ = gate_->address();
  server_->GetHealthCheckService()->SetServingStatus("weft.v1.RenderService", true);
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
