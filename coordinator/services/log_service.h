#pragma once

#include <functional>

#include <grpcpp/support/status.h>

#include "coordinator/scheduler/scheduler.h"
#include "proto/weft/v1/cluster.pb.h"

// The calls about logs, as services make them. Contracts: cluster.proto.
namespace weft::coordinator {

// WorkerService.AppendLog.
[[nodiscard]] grpc::Status append_log(Scheduler& scheduler, const v1::AppendLogRequest& request,
                                      v1::AppendLogResponse& response);

// JobService.ReadLogs. `write` sends a message and says whether the caller is still there. Holds
// one message at a time, whatever the logs' size.
[[nodiscard]] grpc::Status read_logs(Scheduler& scheduler, const v1::ReadLogsRequest& request,
                                     const std::function<bool()>& is_cancelled,
                                     const std::function<bool(const v1::ReadLogsResponse&)>& write);

}  // namespace weft::coordinator
