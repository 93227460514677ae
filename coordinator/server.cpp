#include "coordinator/server.h"

#include <condition_variable>
#include <mutex>
#include <thread>

#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>

#include "coordinator/services/blob_service.h"
#include "coordinator/services/catalogue_service.h"
#include "coordinator/services/job_service.h"
#include "coordinator/services/worker_service.h"
#include "proto/limits.h"
#include "security/server_gate.h"

namespace weft::coordinator {

namespace {

constexpr int kThreadsLimit = 512;  // each call that is answered and each watcher holds one
constexpr auto kGrace = std::chrono::seconds(2);
constexpr auto kBetweenLooks = std::chrono::milliseconds(200);

// As the health service knows them.
constexpr const char* kServices[] = {"weft.v1.WorkerService", "weft.v1.WorkersService",
                                     "weft.v1.BlobService", "weft.v1.JobService",
                                     "weft.v1.CatalogueService"};

}  // namespace

struct Server::Services {
  explicit Services(Scheduler& s)
      : scheduler(s), worker(s), workers(s), blob(s), job(s), catalogue(s) {}

  Scheduler& scheduler;
  WorkerService worker;
  WorkersService workers;
  BlobService blob;
  JobService job;
  CatalogueService catalogue;
  std::unique_ptr<security::ServerGate> gate;
  std::unique_ptr<grpc::Server> server;

  // Says that nothing is served any more from the moment when the journal cannot be written.
  void watch_health() {
    std::unique_lock lock(mutex);
    while (!changed.wait_for(lock, kBetweenLooks, [this] { return is_ending; })) {
      if (scheduler.fatal_problem()) {
        server->GetHealthCheckService()->SetServingStatus(false);
      }
    }
  }

  std::mutex mutex;  // guards is_ending
  std::condition_variable changed;
  bool is_ending = false;
  std::thread health;
};

Server::Server(Scheduler& scheduler, const security::Endpoint& listen)
    : services_(std::make_unique<Services>(scheduler)) {
  services_->gate = std::make_unique<security::ServerGate>(listen);
  grpc::ServerBuilder& builder = services_->gate->builder();
  grpc::ResourceQuota quota("coordinator");
  quota.SetMaxThreads(kThreadsLimit);
  quota.Resize(v1::kServerMemoryLimitBytes);
  builder.SetResourceQuota(quota);
  builder.RegisterService(&services_->worker);
  builder.RegisterService(&services_->workers);
  builder.RegisterService(&services_->blob);
  builder.RegisterService(&services_->job);
  builder.RegisterService(&services_->catalogue);
  services_->server = services_->gate->start();
  address_ = services_->gate->address();
  for (const char* service : kServices) {
    services_->server->GetHealthCheckService()->SetServingStatus(service, true);
  }
  services_->health = std::thread([this] { services_->watch_health(); });
}

Server::~Server() { stop(); }

void Server::stop() {
  if (services_->server != nullptr) {
    services_->server->GetHealthCheckService()->SetServingStatus(false);
    {
      const std::lock_guard lock(services_->mutex);
      services_->is_ending = true;
    }
    services_->changed.notify_all();
    services_->health.join();
  }
  services_->scheduler.stop();
  if (services_->server != nullptr) {
    services_->server->Shutdown(std::chrono::system_clock::now() + kGrace);
    services_->server->Wait();
    services_->server.reset();
  }
}

}  // namespace weft::coordinator
