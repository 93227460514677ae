#include "coordinator/services/log_service.h"

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "core/clock.h"
#include "core/error.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr std::chrono::milliseconds kWaitAtMost{1000};
constexpr std::chrono::milliseconds kGathering{200};  // what one wake-up sends at once
// Workers send the last lines of an attempt a moment after its result.
constexpr double kStragglersSeconds = 2;

bool has_ended(const v1::Job& job) { return job.ended_at_ms() != 0; }

// Follows the logs of one job for one caller.
class LogReader {
 public:
  LogReader(Scheduler& scheduler, const v1::ReadLogsRequest& request,
            const std::function<bool()>& is_cancelled,
            const std::function<bool(const v1::ReadLogsResponse&)>& write)
      : scheduler_(scheduler), is_cancelled_(is_cancelled), write_(write) {
    filter_.set_job_id(request.job_id());
    filter_.set_stage(request.stage());
    filter_.set_with_shard(request.with_shard());
    filter_.set_shard(request.shard());
    only_ = request.attempt();
  }

  grpc::Status run(bool follow) {
    const std::string job = scheduler_.job(filter_.job_id()).id();
    filter_.set_job_id(job);
    look_for_attempts();
    if (only_ != 0 && !wanted_.contains(only_)) {
      return {grpc::StatusCode::NOT_FOUND, "job " + job + " has no attempt " +
                                               std::to_string(only_) +
                                               ", or it is not of this task; ListAttempts (weft "
                                               "logs --list) names all"};
    }
    std::optional<core::Stopwatch> since_end;
    while (true) {
      const bool is_over = has_ended(scheduler_.job(job));
      const std::uint64_t seen = scheduler_.logs().revision(job);
      if (!send_all(job)) {
        return {grpc::StatusCode::CANCELLED, "the caller went away"};
      }
      if (is_over && !since_end) {
        since_end.emplace();
      }
      if (!follow || (since_end && since_end->seconds() > kStragglersSeconds)) {
        return grpc::Status::OK;
      }
      scheduler_.logs().wait_for_change(job, seen, kWaitAtMost);
      std::this_thread::sleep_for(kGathering);
    }
  }

 private:
  void look_for_attempts() {
    for (v1::AttemptInfo& info : scheduler_.attempts(filter_)) {
      const std::uint64_t attempt = info.name().attempt();
      if (only_ == 0 || attempt == only_) {
        wanted_[attempt] = std::move(info);
      }
    }
  }

  // What is there and was not sent yet, attempt by attempt; false when the caller is gone.
  bool send_all(const std::string& job) {
    bool has_looked = false;
    for (const std::uint64_t attempt : scheduler_.logs().attempts(job)) {
      if (is_cancelled_()) {
        return false;
      }
      const bool is_news = !wanted_.contains(attempt) && !unwanted_.contains(attempt);
      if (is_news && !has_looked) {
        look_for_attempts();
        has_looked = true;
      }
      if (!wanted_.contains(attempt)) {
        unwanted_.insert(attempt);
        continue;
      }
      if (!send(job, attempt)) {
        return false;
      }
    }
    return true;
  }

  bool send(const std::string& job, std::uint64_t attempt) {
    std::uint64_t& offset = sent_[attempt];
    while (true) {
      LogStore::Part part = scheduler_.logs().read(job, attempt, offset, v1::kLogChunkLimitBytes);
      if (part.text.empty()) {
        return true;
      }
      v1::ReadLogsResponse response;
      if (named_ != attempt) {
        *response.mutable_attempt() = wanted_.at(attempt);
        named_ = attempt;
      }
      response.set_text(std::move(part.text));
      offset = part.next;
      if (!write_(response)) {
        return false;
      }
    }
  }

  Scheduler& scheduler_;
  const std::function<bool()>& is_cancelled_;
  const std::function<bool(const v1::ReadLogsResponse&)>& write_;
  v1::ListAttemptsRequest filter_;
  std::uint64_t only_ = 0;
  std::uint64_t named_ = 0;  // the attempt whose lines were sent last
  std::map<std::uint64_t, v1::AttemptInfo> wanted_;
  std::set<std::uint64_t> unwanted_;
  std::map<std::uint64_t, std::uint64_t> sent_;  // up to which offset
};

}  // namespace

grpc::Status append_log(Scheduler& scheduler, const v1::AppendLogRequest& request,
                        v1::AppendLogResponse& response) {
  check_id(request.job_id(), "job_id");
  if (request.text().size() > v1::kLogChunkLimitBytes) {
    return {grpc::StatusCode::INVALID_ARGUMENT,
            "text has " + std::to_string(request.text().size()) + " bytes; at most " +
                std::to_string(v1::kLogChunkLimitBytes) + " are allowed"};
  }
  if (!scheduler.was_given(request.job_id(), request.attempt(), request.lease_token())) {
    return {grpc::StatusCode::NOT_FOUND, "job " + request.job_id() + " has no such attempt"};
  }
  const std::optional<std::uint64_t> size = scheduler.logs().append(
      request.job_id(), request.attempt(), request.offset(), request.text());
  if (!size) {
    return {grpc::StatusCode::OUT_OF_RANGE, "the log ends before the offset"};
  }
  response.set_size_bytes(*size);
  return grpc::Status::OK;
}

grpc::Status read_logs(Scheduler& scheduler, const v1::ReadLogsRequest& request,
                       const std::function<bool()>& is_cancelled,
                       const std::function<bool(const v1::ReadLogsResponse&)>& write) {
  LogReader reader(scheduler, request, is_cancelled, write);
  return reader.run(request.follow());
}

}  // namespace weft::coordinator
