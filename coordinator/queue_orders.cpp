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

bool Queue::is_drained(const std::string& worker_name) const {
  return drained_.contains(worker_name);
}

std::vector<StageName> Queue::blocked_stages(const std::string& worker_name) const {
  const auto blocked = blocked_.find(worker_name);
  return blocked == blocked_.end()
             ? std::vector<StageName>{}
             : std::vector<StageName>(blocked->second.begin(), blocked->second.end());
}

// A paused job's attempts own nothing any more: their workers are told to stop when they report.
void Queue::on(const PauseEvent& event, Time now, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job == nullptr || job->has_ended() || job->is_paused == event.is_paused) {
    return;
  }
  job->is_paused = event.is_paused;
  ++job->revision;
  actions.wake = true;
  if (job->is_paused) {
    for (const StageState& stage : job->stages) {
      const std::set<std::uint64_t> attempts = stage.attempts;
      for (const std::uint64_t id : attempts) {
        release(end_attempt(id, Outcome::kStopped, "its job was paused", now, actions));
      }
    }
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
  const auto held = attempts_of_worker_.find(event.worker);
  if (held == attempts_of_worker_.end()) {
    return;
  }
  const std::set<std::uint64_t> ids = held->second;
  for (const std::uint64_t id : ids) {
    lose(id, now, actions);
  }
}

}  // namespace weft::coordinator
