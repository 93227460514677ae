#pragma once

#include "coordinator/scheduler/scheduler.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::coordinator {

// What workers call, and the list of workers for people. Contracts: cluster.proto.
// Synchronize waits without a thread, by gRPC's callbacks.
class WorkerService final
    : public v1::WorkerService::WithCallbackMethod_Synchronize<v1::WorkerService::Service> {
 public:
  explicit WorkerService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::ServerUnaryReactor* Synchronize(grpc::CallbackServerContext* context,
                                        const v1::SynchronizeRequest* request,
                                        v1::SynchronizeResponse* response) override;
  grpc::Status AppendLog(grpc::ServerContext* context, const v1::AppendLogRequest* request,
                         v1::AppendLogResponse* response) override;

 private:
  Scheduler& scheduler_;
};

class WorkersService final : public v1::WorkersService::Service {
 public:
  explicit WorkersService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::Status ListWorkers(grpc::ServerContext* context, const v1::ListWorkersRequest* request,
                           v1::ListWorkersResponse* response) override;
  grpc::Status DrainWorker(grpc::ServerContext* context, const v1::DrainWorkerRequest* request,
                           v1::DrainWorkerResponse* response) override;
  grpc::Status UnblockWorker(grpc::ServerContext* context, const v1::UnblockWorkerRequest* request,
                             v1::UnblockWorkerResponse* response) override;

 private:
  Scheduler& scheduler_;
};

}  // namespace weft::coordinator
