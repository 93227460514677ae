#include "coordinator/services/job_service.h"

#include <thread>

#include "coordinator/services/log_service.h"
#include "coordinator/services/rpc.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr auto kWatchInterval = std::chrono::milliseconds(250);

}  // namespace

grpc::Status JobService::Submit(grpc::ServerContext* context, const v1::SubmitRequest* request,
                                v1::SubmitResponse* response) {
  return answer(*context, "JobService.Submit", [&](const security::Caller& caller) {
    *response->mutable_job() = scheduler_.submit(*request, caller);
    return grpc::Status::OK;
  });
}

grpc::Status JobService::GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                                v1::GetJobResponse* response) {
  return answer(*context, "JobService.GetJob", [&] {
    *response->mutable_job() = scheduler_.job(request->job_id());
    return grpc::Status::OK;
  });
}

grpc::Status JobService::ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                                  v1::ListJobsResponse* response) {
  return answer(*context, "JobService.ListJobs", [&] {
    const bool has_limit = request->limit() > 0 && request->limit() < v1::kListLimit;
    for (v1::Job& job : scheduler_.jobs(request->unfinished_only(),
                                        has_limit ? request->limit() : v1::kListLimit)) {
      response->add_jobs()->Swap(&job);
    }
    return grpc::Status::OK;
  });
}

grpc::Status JobService::WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                                  grpc::ServerWriter<v1::WatchJobResponse>* writer) {
  return answer(*context, "JobService.WatchJob", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = watchers_.enter(*context);
    return send_changes(*context, request->job_id(), *writer);
  });
}

grpc::Status JobService::send_changes(const grpc::ServerContext& context, const std::string& job_id,
                                      grpc::ServerWriter<v1::WatchJobResponse>& writer) {
  const grpc::Status went_away(grpc::StatusCode::CANCELLED, "the caller went away");
  v1::Job job = scheduler_.job(job_id);
  for (;;) {
    v1::WatchJobResponse response;
    *response.mutable_job() = job;
    if (!writer.Write(response)) {
      return went_away;
    }
    if (job.ended_at_ms() != 0) {
      return grpc::Status::OK;
    }
    std::this_thread::sleep_for(kWatchInterval);
    const std::uint64_t seen = job.revision();
    do {
      if (context.IsCancelled()) {
        return went_away;
      }
      job = scheduler_.wait_for_change(job.id(), seen, std::chrono::seconds(1));
    } while (job.revision() == seen);
  }
}

grpc::Status JobService::CancelJob(grpc::ServerContext* context,
                                   const v1::CancelJobRequest* request,
                                   v1::CancelJobResponse* response) {
  return answer(*context, "JobService.CancelJob", [&](const security::Caller& caller) {
    *response->mutable_job() =
        scheduler_.cancel({request->request_id(), request->job_id(), caller});
    return grpc::Status::OK;
  });
}

grpc::Status JobService::PauseJob(grpc::ServerContext* context, const v1::PauseJobRequest* request,
                                  v1::PauseJobResponse* response) {
  return answer(*context, "JobService.PauseJob", [&](const security::Caller& caller) {
    *response->mutable_job() =
        scheduler_.pause({request->request_id(), request->job_id(), caller}, true);
    return grpc::Status::OK;
  });
}

grpc::Status JobService::ResumeJob(grpc::ServerContext* context,
                                   const v1::ResumeJobRequest* request,
                                   v1::ResumeJobResponse* response) {
  return answer(*context, "JobService.ResumeJob", [&](const security::Caller& caller) {
    *response->mutable_job() =
        scheduler_.pause({request->request_id(), request->job_id(), caller}, false);
    return grpc::Status::OK;
  });
}

grpc::Status JobService::RetryJob(grpc::ServerContext* context, const v1::RetryJobRequest* request,
                                  v1::RetryJobResponse* response) {
  return answer(*context, "JobService.RetryJob", [&](const security::Caller& caller) {
    *response->mutable_job() = scheduler_.retry({request->request_id(), request->job_id(), caller});
    return grpc::Status::OK;
  });
}

grpc::Status JobService::SetPriority(grpc::ServerContext* context,
                                     const v1::SetPriorityRequest* request,
                                     v1::SetPriorityResponse* response) {
  return answer(*context, "JobService.SetPriority", [&](const security::Caller& caller) {
    *response->mutable_job() = scheduler_.set_priority(
        {request->request_id(), request->job_id(), caller}, request->priority());
    return grpc::Status::OK;
  });
}

grpc::Status JobService::Explain(grpc::ServerContext* context, const v1::ExplainRequest* request,
                                 v1::ExplainResponse* response) {
  return answer(*context, "JobService.Explain", [&] {
    *response = scheduler_.explain(*request);
    return grpc::Status::OK;
  });
}

grpc::Status JobService::ListAttempts(grpc::ServerContext* context,
                                      const v1::ListAttemptsRequest* request,
                                      v1::ListAttemptsResponse* response) {
  return answer(*context, "JobService.ListAttempts", [&] {
    for (v1::AttemptInfo& attempt : scheduler_.attempts(*request)) {
      response->add_attempts()->Swap(&attempt);
    }
    return grpc::Status::OK;
  });
}

grpc::Status JobService::ReadLogs(grpc::ServerContext* context, const v1::ReadLogsRequest* request,
                                  grpc::ServerWriter<v1::ReadLogsResponse>* writer) {
  return answer(*context, "JobService.ReadLogs", [&]() -> grpc::Status {
    const OpenStreams::Ticket ticket = log_readers_.enter(*context);
    return read_logs(
        scheduler_, *request, [&] { return context->IsCancelled(); },
        [&](const v1::ReadLogsResponse& response) { return writer->Write(response); });
  });
}

}  // namespace weft::coordinator
