#include "coordinator/worker_service.h"

#include "coordinator/rpc.h"

namespace weft::coordinator {

namespace {

// Takes away results whose blobs are not there: they are not verified, and their shards go back to
// the queue.
void keep_verified(const storage::BlobStore& blobs, ReportEvent& report) {
  for (CompletionClaim& claim : report.completions) {
    std::erase_if(claim.results, [&](const ShardResult& result) {
      const bool is_there = blobs.has(result.digest);
      if (!is_there) {
        spdlog::warn("worker={} job={} attempt={} shard={} event=result_without_blob digest={}",
                     report.worker, claim.job, claim.attempt, result.shard, result.digest.hex());
      }
      return !is_there;
    });
  }
}

}  // namespace

grpc::Status WorkerService::Synchronize(grpc::ServerContext* context,
                                        const v1::SynchronizeRequest* request,
                                        v1::SynchronizeResponse* response) {
  return answer(*context, "WorkerService.Synchronize", [&]() -> grpc::Status {
    ReportEvent report = report_from(*request);
    keep_verified(scheduler_.blobs(), report);
    std::optional<v1::SynchronizeResponse> reply = scheduler_.synchronize(
        std::move(report), request->sequence(), std::chrono::milliseconds(request->wait_ms()),
        [&] { return context->IsCancelled(); });
    if (!reply) {
      return {grpc::StatusCode::ABORTED, "a newer call of this worker was seen"};
    }
    response->Swap(&*reply);
    return grpc::Status::OK;
  });
}

grpc::Status WorkersService::ListWorkers(grpc::ServerContext* context,
                                         const v1::ListWorkersRequest* /*request*/,
                                         v1::ListWorkersResponse* response) {
  return answer(*context, "WorkersService.ListWorkers", [&] {
    for (v1::Worker& worker : scheduler_.workers()) {
      response->add_workers()->Swap(&worker);
    }
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
