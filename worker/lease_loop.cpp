#include "worker/lease_loop.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "worker/back_off.h"
#include "worker/baker.h"

namespace weft::worker {

namespace {

constexpr double kLeavingSeconds = 10;
constexpr std::chrono::milliseconds kPoll{50};
constexpr std::uint32_t kLongestWaitMs = 5000;
constexpr std::uint32_t kShortestWaitMs = 200;
constexpr std::uint32_t kAnswerAllowanceMs = 10'000;
constexpr double kSeatsSeconds = 3;  // how long threads may take to see that all is over
constexpr std::size_t kRootDigits = 12;

std::string random_id() {
  std::random_device device;
  return fmt::format("{:08x}{:08x}", device(), device());
}

// Where workers of this coordinator on this machine keep what is not acknowledged.
std::filesystem::path spool_root(const WorkerOptions& options) {
  return options.scratch / "spool" /
         core::digest_of(options.coordinator).hex().substr(0, kRootDigits);
}

// Whether the coordinator's answer means that this worker will never be taken.
bool is_refusal(const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::PERMISSION_DENIED:
    case grpc::StatusCode::UNAUTHENTICATED:
    case grpc::StatusCode::UNIMPLEMENTED:
      return true;
    default:
      return false;
  }
}

}  // namespace

LeaseLoop::LeaseLoop(WorkerOptions options, const std::shared_ptr<grpc::Channel>& channel)
    : options_(std::move(options)),
      id_(random_id()),
      fingerprint_(numerics_fingerprint()),
      stub_(v1::WorkerService::NewStub(channel)),
      blobs_(channel),
      inputs_(options_.scratch, options_.scratch_limit_bytes, blobs_),
      bakers_(inputs_, options_.make_baker, options_.threads),
      spool_(spool_root(options_), id_, options_.spool_limit_bytes),
      logs_(channel),
      table_(options_.threads),
      seats_(options_.threads) {}

void LeaseLoop::run(const std::function<bool()>& should_leave) {
  spdlog::info("worker={} name={} threads={} fingerprint={} scratch={} state=started", id_,
               options_.name, options_.threads, fingerprint_.hex().substr(0, 12),
               options_.scratch.string());
  std::vector<std::jthread> threads;
  threads.emplace_back([this] { synchronize(); });
  threads.emplace_back([this] { upload(); });
  threads.emplace_back([this] { keep_house(); });
  threads.emplace_back([this] { logs_.run(); });
  for (Seat& seat : seats_) {
    threads.emplace_back([this, &seat] { compute(seat); });
  }
  std::optional<core::Stopwatch> since_leaving;
  std::unique_lock lock(mutex_);
  while (!has_left_) {
    changed_.wait_for(lock, kPoll);
    lock.unlock();
    const char* const reason = since_leaving ? nullptr : reason_to_leave(should_leave);
    if (reason != nullptr) {
      since_leaving.emplace();
      begin_leaving(reason);
    }
    if (since_leaving && since_leaving->seconds() > kLeavingSeconds) {
      is_giving_up_.store(true);
      tell_news();
    }
    lock.lock();
  }
  lock.unlock();
  finish_up();
  threads.clear();
  if (failure_) {
    std::rethrow_exception(failure_);
  }
}

// Why this worker should end now; null while it should not.
const char* LeaseLoop::reason_to_leave(const std::function<bool()>& should_leave) {
  if (should_leave()) {
    return "asked";
  }
  if (options_.wall_limit_seconds > 0 && wall_left_seconds() <= 0) {
    return "wall_limit";
  }
  const std::lock_guard lock(mutex_);
  if (stuck_ == options_.threads) {
    return "every_thread_hangs";
  }
  if (!table_.is_empty()) {
    since_busy_ = core::Stopwatch();
  }
  const bool is_idle =
      options_.idle_limit_seconds > 0 && since_busy_.seconds() > options_.idle_limit_seconds;
  return is_idle ? "idle" : nullptr;
}

double LeaseLoop::wall_left_seconds() const {
  // Leaving takes time too, and must be over when the limit is.
  const double leaving = std::min(kLeavingSeconds, options_.wall_limit_seconds / 4);
  return options_.wall_limit_seconds - leaving - since_start_.seconds();
}

void LeaseLoop::begin_leaving(const char* why) {
  is_leaving_.store(true);
  {
    const std::lock_guard lock(mutex_);
    table_.drain();
  }
  spdlog::info("worker={} reason={} state=leaving", id_, why);
  tell_news();
}

// Ends all threads, or the process where one does not end.
void LeaseLoop::finish_up() {
  is_leaving_.store(true);
  is_giving_up_.store(true);
  tell_news();
  blobs_.close();
  spool_.close();
  logs_.close();
  std::uint64_t lost = 0;
  bool is_refused = false;
  bool is_stuck = false;
  {
    const std::lock_guard lock(mutex_);
    lost = table_.unacknowledged();
    is_refused = failure_ != nullptr;
    is_stuck = stuck_ == options_.threads;
  }
  const bool is_quiet = wait_for_seats(kSeatsSeconds);
  spdlog::info("worker={} unacknowledged={} state=ended", id_, lost);
  if (!is_quiet && options_.end_process) {
    spdlog::error("worker={} event=threads_do_not_return: the process is ended with them{}", id_,
                  is_stuck ? "; no thread was left to compute, start it again" : "");
    options_.end_process(is_stuck || is_refused ? 1 : 0);
  }
}

v1::SynchronizeRequest LeaseLoop::next_request(grpc::ClientContext& context) {
  v1::SynchronizeRequest request;
  request.set_request_id(fmt::format("{}-{}", id_, ++sequence_));
  request.set_worker_id(id_);
  request.set_sequence(sequence_);
  request.set_name(options_.name);
  request.set_memory_bytes(options_.memory_bytes);
  for (const std::string& label : options_.labels) {
    request.add_labels(label);
  }
  if (options_.wall_limit_seconds > 0) {
    request.set_wall_left_ms(std::max<std::uint64_t>(
        1, static_cast<std::uint64_t>(1000 * std::max(0.0, wall_left_seconds()))));
  }
  for (const core::Digest& scene : bakers_.scenes()) {
    request.add_scenes(scene.binary());
  }
  request.set_fingerprint(fingerprint_.binary());
  const bool is_leaving = is_leaving_.load();
  request.set_leaving(is_leaving);
  request.set_wait_ms(is_leaving ? 0 : wait_ms_);
  const auto deadline_ms = static_cast<std::int64_t>(request.wait_ms()) + kAnswerAllowanceMs;
  context.set_deadline(
      gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_millis(deadline_ms, GPR_TIMESPAN)));
  const std::lock_guard lock(mutex_);
  request.set_threads(std::max(1U, options_.threads - stuck_));
  table_.fill(request);
  free_told_ = request.free_attempts();
  has_news_ = false;
  waiting_call_ = &context;
  return request;
}

void LeaseLoop::synchronize() {
  BackOff back_off;
  bool is_away = false;
  while (!is_giving_up_.load()) {
    grpc::ClientContext context;
    const v1::SynchronizeRequest request = next_request(context);
    v1::SynchronizeResponse response;
    const grpc::Status status = stub_->Synchronize(&context, request, &response);
    bool was_interrupted = false;
    bool is_done = false;
    {
      const std::lock_guard lock(mutex_);
      waiting_call_ = nullptr;
      was_interrupted = has_news_;
    }
    if (status.ok()) {
      back_off.reset();
      if (is_away || sequence_ == 1) {
        spdlog::info("worker={} coordinator=answers", id_);
        is_away = false;
      }
      apply(response);
      const std::lock_guard lock(mutex_);
      is_done = is_leaving_.load() && request.leaving() && table_.is_empty();
    } else if (is_refusal(status)) {
      const std::lock_guard lock(mutex_);
      failure_ = std::make_exception_ptr(
          core::Error(core::Code::kFailedPrecondition,
                      "the coordinator refuses this worker: " + status.error_message()));
      is_done = true;
    } else if (!was_interrupted && status.error_code() != grpc::StatusCode::ABORTED) {
      if (!is_away) {
        const std::string problem =
            options_.connection_problem ? options_.connection_problem() : std::string();
        spdlog::warn("worker={} coordinator=away error=\"{}\"", id_,
                     problem.empty() ? status.error_message() : problem);
        is_away = true;
      }
      // A coordinator that comes back must hear of us within a lease.
      back_off.limit(std::chrono::milliseconds(wait_ms_));
      back_off.wait([this] { return is_giving_up_.load(); });
    }
    if (is_done) {
      break;
    }
    if (status.ok() && response.next_poll_ms() > 0) {
      pause(response.next_poll_ms());
    } else if (is_leaving_.load()) {
      pause(kPoll.count());
    }
  }
  const std::lock_guard lock(mutex_);
  has_left_ = true;
  changed_.notify_all();
}

void LeaseLoop::pause(std::uint32_t for_ms) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, std::chrono::milliseconds(std::min(for_ms, kLongestWaitMs)),
                    [this] { return has_news_; });
}

void LeaseLoop::apply(const v1::SynchronizeResponse& response) {
  std::uint32_t shortest_lease_ms = 3 * kLongestWaitMs;
  for (const v1::Lease& lease : response.leases()) {
    shortest_lease_ms = std::min(shortest_lease_ms, lease.lease_ms());
  }
  for (const v1::Assignment& assignment : response.assignments()) {
    shortest_lease_ms = std::min(shortest_lease_ms, assignment.lease_ms());
  }
  wait_ms_ = std::clamp(shortest_lease_ms / 3, kShortestWaitMs, kLongestWaitMs);
  AttemptTable::Changes changes;
  {
    const std::lock_guard lock(mutex_);
    changes = table_.apply(response);
    changed_.notify_all();
  }
  for (const auto& attempt : changes.assigned) {
    spdlog::info("worker={} {} state=assigned", id_, log_name(*attempt));
    const v1::Assignment& assignment = attempt->assignment;
    attempt->log.add(fmt::format(
        "begins on {} ({}, {} threads): {} of {}, shards {} to {} of {}", options_.name, id_,
        options_.threads, assignment.stage(), assignment.fabric(), assignment.first_shard(),
        assignment.first_shard() + assignment.shards() - 1, assignment.shard_count()));
    logs_.follow(attempt);
  }
  for (const auto& attempt : changes.revoked) {
    spdlog::info("worker={} {} state=revoked", id_, log_name(*attempt));
    attempt->log.add_important("stopped: the coordinator does not want it any more");
    logs_.hurry();
  }
  forget_what_is_over();
}

void LeaseLoop::forget_what_is_over() {
  std::vector<v1::AttemptName> names;
  {
    const std::lock_guard lock(mutex_);
    names = table_.take_forgotten();
  }
  for (const v1::AttemptName& name : names) {
    spool_.forget(name);
  }
}

void LeaseLoop::tell_news() {
  const std::lock_guard lock(mutex_);
  has_news_ = true;
  if (waiting_call_ != nullptr) {
    waiting_call_->TryCancel();
  }
  changed_.notify_all();
}

}  // namespace weft::worker
