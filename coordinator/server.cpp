#include "coordinator/server.h"

#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>

#include "coordinator/blob_service.h"
#include "coordinator/catalogue_service.h"
#include "coordinator/job_service.h"
#include "coordinator/worker_service.h"
#include "security/server_gate.h"

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
  std::unique_ptr<security::ServerGate> gate;
  std::unique_ptr<grpc::Server> server;
};

Server::Server(Scheduler& scheduler, const security::Endpoint& listen)
    : services_(std::make_unique<Services>(scheduler)) {
  grpc::ServerBuilder builder;
  services_->gate = std::make_unique<security::ServerGate>(builder, listen);
  grpc::ResourceQuota quota("coordinator");
  quota.SetMaxThreads(kThreadsLimit);
  builder.SetResourceQuota(quota);
  builder.RegisterService(&services_->worker);
  builder.RegisterService(&services_->workers);
  builder.RegisterService(&services_->blob);
  builder.RegisterService(&services_->job);
  builder.RegisterService(&services_->catalogue);
  services_->server = builder.BuildAndStart();
  address_ = services_->gate->address();
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
