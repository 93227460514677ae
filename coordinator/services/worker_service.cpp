#include "coordinator/services/worker_service.h"

#include "coordinator/services/log_service.h"
#include "coordinator/services/rpc.h"

namespace weft::coordinator {

namespace {

// Takes away results whose blobs are not there: they are not verified, and their shards go back to
// the queue.
void keep_verified(const storage::BlobStore& blobs, ReportEvent& report) {
  for (CompletionClaim& claim : report.completions) {
    std::erase_if(claim.results, [&](const ShardResult& result) {
      const bool is_there = blobs.use(result.digest).has_value();
      if (!is_there) {
        spdlog::warn("worker={} job={} attempt={} shard={} event=result_without_blob digest={}",
                     report.worker, claim.job, claim.attempt, result.shard, result.digest.hex());
      }
      return !is_there;
    });
  }
}

// One Synchronize call. It is over, and this deleted, when both gRPC and the scheduler are done
// with it: the scheduler answers each call once, one that was cancelled too.
class Exchange final : public grpc::ServerUnaryReactor {
 public:
  Exchange(Scheduler& scheduler, const v1::SynchronizeRequest& request,
           v1::SynchronizeResponse& response)
      : scheduler_(scheduler),
        worker_(request.worker_id()),
        sequence_(request.sequence()),
        response_(response) {}

  void start(const grpc::CallbackServerContext& context, const v1::SynchronizeRequest& request) {
    const grpc::Status status = status_of("WorkerService.Synchronize", [&] {
      const security::Caller caller = security::check_role(context, "WorkerService.Synchronize");
      ReportEvent report = report_from(request);
      security::check_worker_name(caller, report.name);
      keep_verified(scheduler_.blobs(), report);
      scheduler_.synchronize(
          std::move(report), sequence_, std::chrono::milliseconds(request.wait_ms()),
          [this](std::optional<v1::SynchronizeResponse> answer,
                 const std::optional<core::Error>& problem) { end(std::move(answer), problem); });
      return grpc::Status::OK;
    });
    if (!status.ok()) {
      Finish(status);
    }
  }

  // The caller cancelled or its connection closed.
  void OnCancel() override { scheduler_.abandon(worker_, sequence_); }
  void OnDone() override { delete this; }  // as gRPC asks of a reactor made by new

 private:
  void end(std::optional<v1::SynchronizeResponse> answer,
           const std::optional<core::Error>& problem) {
    if (problem) {
      Finish(v1::to_status(*problem));
    } else if (!answer) {
      Finish({grpc::StatusCode::ABORTED, "a newer call of this worker was seen"});
    } else {
      response_.Swap(&*answer);
      Finish(grpc::Status::OK);
    }
  }

  Scheduler& scheduler_;
  const std::string worker_;
  const std::uint64_t sequence_;
  v1::SynchronizeResponse& response_;
};

}  // namespace

grpc::ServerUnaryReactor* WorkerService::Synchronize(grpc::CallbackServerContext* context,
                                                     const v1::SynchronizeRequest* request,
                                                     v1::SynchronizeResponse* response) {
  auto* const exchange = new Exchange(scheduler_, *request, *response);  // see OnDone
  exchange->start(*context, *request);
  return exchange;
}

grpc::Status WorkerService::AppendLog(grpc::ServerContext* context,
                                      const v1::AppendLogRequest* request,
                                      v1::AppendLogResponse* response) {
  return answer(*context, "WorkerService.AppendLog",
                [&] { return append_log(scheduler_, *request, *response); });
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

grpc::Status WorkersService::DrainWorker(grpc::ServerContext* context,
                                         const v1::DrainWorkerRequest* request,
                                         v1::DrainWorkerResponse* response) {
  return answer(*context, "WorkersService.DrainWorker", [&](const security::Caller& caller) {
    for (v1::Worker& worker : scheduler_.drain({request->request_id(), request->worker(), caller},
                                               !request->undrain())) {
      response->add_workers()->Swap(&worker);
    }
    return grpc::Status::OK;
  });
}

grpc::Status WorkersService::UnblockWorker(grpc::ServerContext* context,
                                           const v1::UnblockWorkerRequest* request,
                                           v1::UnblockWorkerResponse* response) {
  return answer(*context, "WorkersService.UnblockWorker", [&](const security::Caller& caller) {
    for (v1::Worker& worker :
         scheduler_.unblock({request->request_id(), request->worker(), caller}, request->stage())) {
      response->add_workers()->Swap(&worker);
    }
    return grpc::Status::OK;
  });
}

}  // namespace weft::coordinator
