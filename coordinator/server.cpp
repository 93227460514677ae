#include "coordinator/server.h"

#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>

#include "coordinator/blob_service.h"
#include "coordinator/catalogue_service.h"
#include "coordinator/job_service.h"
#include "coordinator/worker_service.h"
#include "core/error.h"
#include "proto/address.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr int kThreadsLimit = 512;  // each waiting worker and watcher holds one
constexpr auto kGrace = std::chrono::seconds(2);

}  // namespace

struct Server::Services {
  explicit Services(Scheduler& s)
      : scheduler(s), worker(s), workers(s), blob(s), job(s), catalogue(s.catalogue()) {}

  Scheduler& scheduler;
  WorkerService worker;
  WorkersService workers;
  BlobService blob;
  JobService job;
  CatalogueService catalogue;
  std::unique_ptr<grpc::Server> server;
};

Server::Server(Scheduler& scheduler, const std::string& listen, bool insecure)
    : services_(std::make_unique<Services>(scheduler)), address_(listen) {
  if (!insecure && !v1::is_local_address(listen)) {
    throw core::Error(core::Code::kPermissionDenied,
                      listen +
                          " can be reached from other machines, and calls are neither "
                          "encrypted nor checked; listen on 127.0.0.1:PORT or unix:PATH, or "
                          "say --insecure in a network that you trust");
  }
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(listen, grpc::InsecureServerCredentials(), &port);
  // Two coordinators must not share a port.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.SetMaxReceiveMessageSize(v1::kMessageLimitBytes);
  builder.SetMaxSendMessageSize(v1::kMessageLimitBytes);
  grpc::ResourceQuota quota("coordinator");
  quota.SetMaxThreads(kThreadsLimit);
  builder.SetResourceQuota(quota);
  builder.RegisterService(&services_->worker);
  builder.RegisterService(&services_->workers);
  builder.RegisterService(&services_->blob);
  builder.RegisterService(&services_->job);
  builder.RegisterService(&services_->catalogue);
  services_->server = builder.BuildAndStart();
  if (services_->server == nullptr || port == 0) {
    throw core::Error(core::Code::kUnavailable,
                      "cannot listen on " + listen +
                          "; is it written HOST:PORT or unix:PATH, and is another coordinator "
                          "using it?");
  }
  if (!listen.starts_with("unix:")) {
    address_ = listen.substr(0, listen.rfind(':') + 1) + std::to_string(port);
  }
}

Server::~Server() { stop(); }

void Server::stop() {
  services_->scheduler.stop();
  if (services_->server != nullptr) {
    services_->server->Shutdown(std::chrono::system_clock::now() + kGrace);
    services_->server->Wait();
    services_->server.reset();
  }
}

}  // namespace weft::coordinator
