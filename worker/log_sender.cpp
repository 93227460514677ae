#include "worker/log_sender.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <grpcpp/client_context.h>
#include <spdlog/spdlog.h>

namespace weft::worker {

namespace {

constexpr std::chrono::seconds kPeriod{1};
constexpr std::chrono::milliseconds kGathering{100};
constexpr std::int64_t kDeadlineMs = 2000;
constexpr std::size_t kAttemptsLimit = 256;

grpc::Status call(v1::WorkerService::Stub& stub, const v1::AppendLogRequest& request,
                  v1::AppendLogResponse* response) {
  grpc::ClientContext context;
  context.set_deadline(
      gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_millis(kDeadlineMs, GPR_TIMESPAN)));
  return stub.AppendLog(&context, request, response);
}

}  // namespace

LogSender::LogSender(const std::shared_ptr<grpc::Channel>& channel)
    : stub_(v1::WorkerService::NewStub(channel)) {}

void LogSender::follow(std::shared_ptr<Attempt> attempt) {
  const std::lock_guard lock(mutex_);
  attempts_.push_back({std::move(attempt), false});
  if (attempts_.size() > kAttemptsLimit) {
    const auto ended =
        std::find_if(attempts_.begin(), attempts_.end(),
                     [](const Followed& followed) { return followed.attempt->is_over.load(); });
    if (ended != attempts_.end()) {
      attempts_.erase(ended);
    }
  }
}

void LogSender::hurry() {
  const std::lock_guard lock(mutex_);
  is_hurried_ = true;
  changed_.notify_all();
}

void LogSender::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  changed_.notify_all();
}

void LogSender::run() {
  while (wait()) {
    send_round();
  }
  send_round();
}

// Until it is time to send; false once closed.
bool LogSender::wait() {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kPeriod, [&] { return is_closed_ || is_hurried_; });
  if (is_hurried_) {  // runs of few shards end in quick succession
    changed_.wait_for(lock, kGathering, [&] { return is_closed_; });
  }
  is_hurried_ = false;
  return !is_closed_;
}

void LogSender::send_round() {
  std::vector<Followed> round;
  {
    const std::lock_guard lock(mutex_);
    round = attempts_;
    for (Followed& followed : attempts_) {
      followed.was_over = followed.attempt->is_over.load();
    }
  }
  for (const Followed& followed : round) {
    const Sent sent = send(*followed.attempt);
    if (sent == Sent::kNotNow) {
      return;
    }
    if (sent == Sent::kGone || followed.was_over) {
      const std::lock_guard lock(mutex_);
      std::erase_if(attempts_, [&](const Followed& f) { return f.attempt == followed.attempt; });
    }
  }
}

LogSender::Sent LogSender::send(Attempt& attempt) const {
  while (attempt.log.has_more()) {
    AttemptLog::Piece piece = attempt.log.next_piece();
    const v1::AttemptName& name = attempt.assignment.name();
    v1::AppendLogRequest request;
    request.set_job_id(name.job_id());
    request.set_attempt(name.attempt());
    request.set_lease_token(attempt.assignment.lease_token());
    request.set_offset(piece.offset);
    request.set_text(std::move(piece.text));
    v1::AppendLogResponse response;
    grpc::Status status = call(*stub_, request, &response);
    if (status.error_code() == grpc::StatusCode::OUT_OF_RANGE) {
      // The coordinator has lost some of it: asks how much is there, and goes on from that.
      request.set_offset(0);
      request.clear_text();
      status = call(*stub_, request, &response);
    }
    switch (status.error_code()) {
      case grpc::StatusCode::OK:
        if (response.size_bytes() == piece.offset) {
          return Sent::kNotNow;  // nothing was taken
        }
        attempt.log.arrived(response.size_bytes());
        break;
      case grpc::StatusCode::UNAVAILABLE:
      case grpc::StatusCode::DEADLINE_EXCEEDED:
      case grpc::StatusCode::CANCELLED:
      case grpc::StatusCode::RESOURCE_EXHAUSTED:
        return Sent::kNotNow;
      default:
        spdlog::debug("job={} attempt={} event=log_refused error=\"{}\"", name.job_id(),
                      name.attempt(), status.error_message());
        return Sent::kGone;
    }
  }
  return Sent::kAll;
}

}  // namespace weft::worker
