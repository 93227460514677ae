#include <algorithm>

#include "coordinator/queue.h"

// What people order: pause, priority, drain, unblock; and what the network says of a worker.

namespace weft::coordinator {

const char* to_string(Purpose purpose) {
  switch (purpose) {
    case Purpose::kFirst:
      return "first";
    case Purpose::kSpeculation:
      return "speculation";
    case Purpose::kAudit:
      return "audit";
  }
  return "unknown";
}

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::kSucceeded:
      return "succeeded";
    case Outcome::kFailed:
      return "failed";
    case Outcome::kLost:
      return "lost";
    case Outcome::kHung:
      return "hung";
    case Outcome::kSuperseded:
      return "superseded";
    case Outcome::kStopped:
      return "stopped";
  }
  return "unknown";
}

// A paused job's attempts own nothing any more: their workers are told to stop when they report.
void Queue::on(const PauseEvent& event, Time /*now*/, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job == nullptr || job->has_ended() || job->is_paused == event.is_paused) {
    return;
  }
  job->is_paused = event.is_paused;
  ++job->revision;
  actions.wake = true;
  if (job->is_paused) {
    std::erase_if(attempts_, [&](const auto& entry) {
      if (entry.second.job != job->id) {
        return false;
      }
      release(entry.second);
      return true;
    });
  }
}

void Queue::on(const PriorityEvent& event, Time /*now*/, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job != nullptr && !job->has_ended()) {
    job->demands.priority = event.priority;
    ++job->revision;
    actions.wake = true;
  }
}

void Queue::on(const DrainEvent& event, Time /*now*/, Actions& actions) {
  if (event.is_drained) {
    drained_.insert(event.worker_name);
  } else {
    drained_.erase(event.worker_name);
    actions.wake = true;
  }
}

void Queue::on(const BlockEvent& event, Time /*now*/, Actions& actions) {
  if (event.is_blocked) {
    blocked_[event.worker_name].insert(event.stage);
    return;
  }
  const auto blocked = blocked_.find(event.worker_name);
  if (blocked != blocked_.end() && blocked->second.erase(event.stage) > 0) {
    actions.wake = true;
  }
}

void Queue::on(const DisconnectEvent& event, Time now, Actions& actions) {
  for (auto& [id, attempt] : attempts_) {
    if (attempt.worker == event.worker) {
      attempt.lease_until = std::min(attempt.lease_until, now - std::chrono::milliseconds(1));
    }
  }
  expire(now, actions);
}

}  // namespace weft::coordinator
