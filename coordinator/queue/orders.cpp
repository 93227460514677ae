#include <algorithm>

#include "coordinator/queue/queue.h"

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
  std::vector<StageName> stages;
  const auto blocked = blocked_.find(worker_name);
  if (blocked != blocked_.end()) {
    for (const auto& [stage, is_liar] : blocked->second) {
      stages.push_back(stage);
    }
  }
  return stages;
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
    stop_attempts(*job, Outcome::kStopped, "its job was paused", now, actions);
  }
  refresh(*job, now);
}

void Queue::on(const PriorityEvent& event, Time /*now*/, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job != nullptr && !job->has_ended()) {
    job->demands.priority = event.priority;
    ++job->revision;
    actions.wake = true;
  }
}

void Queue::on(const DrainEvent& event, Time now, Actions& actions) {
  if (event.is_drained) {
    drained_.insert(event.worker_name);
  } else {
    drained_.erase(event.worker_name);
    actions.wake = true;
  }
  for (auto& [id, worker] : workers_) {
    if (worker.name == event.worker_name) {
      count(worker, now);
    }
  }
}

void Queue::on(const BlockEvent& event, Time /*now*/, Actions& actions) {
  if (event.is_blocked) {
    blocked_[event.worker_name][event.stage] = event.is_liar;
    return;
  }
  conduct_.erase({event.worker_name, event.stage});
  const auto blocked = blocked_.find(event.worker_name);
  if (blocked == blocked_.end() || blocked->second.erase(event.stage) == 0) {
    return;
  }
  if (blocked->second.empty()) {
    blocked_.erase(blocked);
  }
  actions.blocks.push_back({event.worker_name, event.stage, false, false});
  actions.wake = true;
}

void Queue::on(const DisconnectEvent& event, Time now, Actions& actions) {
  const auto worker = workers_.find(event.worker);
  if (worker != workers_.end()) {
    worker->second.is_disconnected = true;
    count(worker->second, now);
  }
  std::vector<std::uint64_t> held;
  for (const Attempt* const attempt : attempts_of(event.worker)) {
    held.push_back(attempt->id);
  }
  for (const std::uint64_t id : held) {
    lose(id, now, actions);
  }
}

}  // namespace weft::coordinator
