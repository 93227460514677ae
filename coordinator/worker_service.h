#pragma once

#include "coordinator/scheduler.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::coordinator {

// What workers call, and the list of workers for people. Contracts: cluster.proto.
class WorkerService final : public v1::WorkerService::Service {
 public:
  explicit WorkerService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::Status Synchronize(grpc::ServerContext* context, const v1::SynchronizeRequest* request,
                           v1::SynchronizeResponse* response) override;

 private:
  Scheduler& scheduler_;
};

class WorkersService final : public v1::WorkersService::Service {
 public:
  explicit WorkersService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::Status ListWorkers(grpc::ServerContext* context, const v1::ListWorkersRequest* request,
                           v1::ListWorkersResponse* response) override;

 private:
  Scheduler& scheduler_;
};

}  // namespace weft::coordinator
