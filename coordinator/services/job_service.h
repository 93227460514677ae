#pragma once

#include "coordinator/scheduler/scheduler.h"
#include "coordinator/services/open_streams.h"
#include "proto/limits.h"
#include "proto/weft/v1/cluster.grpc.pb.h"

namespace weft::coordinator {

// What people do with jobs. Contracts: cluster.proto.
class JobService final : public v1::JobService::Service {
 public:
  explicit JobService(Scheduler& scheduler) : scheduler_(scheduler) {}
  grpc::Status Submit(grpc::ServerContext* context, const v1::SubmitRequest* request,
                      v1::SubmitResponse* response) override;
  grpc::Status GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                      v1::GetJobResponse* response) override;
  grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override;
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override;
  grpc::Status CancelJob(grpc::ServerContext* context, const v1::CancelJobRequest* request,
                         v1::CancelJobResponse* response) override;
  grpc::Status PauseJob(grpc::ServerContext* context, const v1::PauseJobRequest* request,
                        v1::PauseJobResponse* response) override;
  grpc::Status ResumeJob(grpc::ServerContext* context, const v1::ResumeJobRequest* request,
                         v1::ResumeJobResponse* response) override;
  grpc::Status RetryJob(grpc::ServerContext* context, const v1::RetryJobRequest* request,
                        v1::RetryJobResponse* response) override;
  grpc::Status SetPriority(grpc::ServerContext* context, const v1::SetPriorityRequest* request,
                           v1::SetPriorityResponse* response) override;
  grpc::Status Explain(grpc::ServerContext* context, const v1::ExplainRequest* request,
                       v1::ExplainResponse* response) override;
  grpc::Status ListAttempts(grpc::ServerContext* context, const v1::ListAttemptsRequest* request,
                            v1::ListAttemptsResponse* response) override;
  grpc::Status ReadLogs(grpc::ServerContext* context, const v1::ReadLogsRequest* request,
                        grpc::ServerWriter<v1::ReadLogsResponse>* writer) override;

 private:
  // Sends the job whenever its revision is another, until it has ended or the caller is gone.
  grpc::Status send_changes(const grpc::ServerContext& context, const std::string& job_id,
                            grpc::ServerWriter<v1::WatchJobResponse>& writer);

  Scheduler& scheduler_;
  OpenStreams watchers_{"watchers", v1::kWatchersLimit, v1::kWatchersPerConnectionLimit};
  OpenStreams log_readers_{"log_readers", v1::kLogReadersLimit, v1::kLogReadersPerConnectionLimit};
};

}  // namespace weft::coordinator
