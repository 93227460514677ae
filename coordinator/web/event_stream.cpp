#include "coordinator/web/event_stream.h"

#include <utility>

#include <fmt/format.h>

#include "coordinator/scheduler/messages.h"
#include "coordinator/web/json.h"
#include "core/clock.h"
#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::chrono::milliseconds kRound{1000};
// After so many rounds without news a comment is sent, which shows whether the browser is there.
constexpr int kQuietRoundsLimit = 10;
constexpr const char* kNames[kSections] = {"jobs", "workers", "fabrics"};

}  // namespace

EventStream::EventStream(Scheduler& scheduler, Board& board, std::string job,
                         std::function<void()> check)
    : scheduler_(scheduler), watcher_(board), job_(std::move(job)), check_(std::move(check)) {
  if (!job_.empty()) {
    job_ = scheduler_.job(job_).id();
  }
}

void EventStream::add(std::string& events, const char* name, const std::string& value) {
  events += fmt::format("event: {}\ndata: {{\"now_ms\":{},\"value\":{}}}\n\n", name,
                        to_ms(core::system_clock().now()), value);
}

void EventStream::add_job(std::string& events) {
  v1::GetJobResponse response;
  *response.mutable_job() = scheduler_.job(job_);
  std::string job = json_of(response);
  if (job != sent_job_) {
    add(events, "job", job);
    sent_job_ = std::move(job);
  }
  v1::ExplainRequest request;
  request.set_job_id(job_);
  std::string reasons = json_of(scheduler_.explain(request));
  if (reasons != sent_reasons_) {
    add(events, "explain", reasons);
    sent_reasons_ = std::move(reasons);
  }
}

bool EventStream::send(const HttpAnswer::Write& write) {
  const Board::Views views = watcher_.wait(seen_, kRound);
  std::string events;
  if (!has_begun_) {
    events = "retry: 2000\n\n";
    has_begun_ = true;
  }
  try {
    check_();
    if (watcher_.is_over()) {
      return false;
    }
    for (std::size_t i = 0; i < kSections; ++i) {
      if (views[i].revision > seen_[i].revision) {
        add(events, kNames[i], *views[i].text);
      }
    }
    seen_ = views;
    if (!job_.empty()) {
      add_job(events);
    }
  } catch (const core::Error& error) {
    add(events, "over", json_of(error));
    static_cast<void>(write(events));
    return false;
  }
  if (events.empty() && ++quiet_rounds_ < kQuietRoundsLimit) {
    return true;
  }
  quiet_rounds_ = 0;
  return write(events.empty() ? ":\n\n" : events);
}

}  // namespace weft::coordinator
