#include <algorithm>

#include "tests/simulation/world.h"

// Every state has an owner and a deadline: a job that nobody works on, though somebody could, must
// be waiting for a time that comes.

namespace weft::simulation {

using namespace coordinator;

namespace {

// An idle worker asks at least so often; longer than any look, tick or answer takes.
constexpr std::uint64_t kStuckMs = 100'000;

bool has_labels(const WorkerState& worker, const JobState& job) {
  const std::vector<std::string>& labels = job.demands.labels;
  return std::all_of(labels.begin(), labels.end(), [&](const std::string& label) {
    return std::find(worker.labels.begin(), worker.labels.end(), label) != worker.labels.end();
  });
}

// Whether a shard of the stage is there for this worker now.
bool has_work(const StageState& stage, const WorkerState& worker, Time now) {
  const auto backoff = stage.backoffs.find(worker.id);
  if (backoff != stage.backoffs.end() && now < backoff->second.until) {
    return false;
  }
  if (stage.memory_bytes > worker.memory_bytes || worker.wall_left_ms > 0) {
    return false;  // one that ends soon may be right to take nothing
  }
  for (std::uint64_t i = 0; i < stage.shards.size(); ++i) {
    const auto trouble = stage.troubles.find(i);
    const bool is_free =
        trouble == stage.troubles.end() ||
        (trouble->second.retry_at <= now && !trouble->second.failures.contains(worker.name));
    if (stage.shards[i] == ShardState::kPending && is_free) {
      return true;
    }
  }
  return false;
}

}  // namespace

// Whether some worker that is there and has nothing to do may take a shard of the job.
bool World::could_run(const JobState& job) const {
  const Queue& queue = *coordinator_.queue();
  const Time now = coordinator_.now();
  return std::any_of(queue.workers().begin(), queue.workers().end(), [&](const auto& entry) {
    const WorkerState& worker = entry.second;
    const bool is_there = queue.is_live(worker, now) && !queue.is_drained(worker.name) &&
                          queue.attempts_of(worker.id).empty() &&
                          worker.fingerprint == job.fingerprint && has_labels(worker, job);
    const std::vector<StageName> blocked = queue.blocked_stages(worker.name);
    return is_there && std::any_of(job.stages.begin(), job.stages.end(), [&](const auto& stage) {
             return std::find(blocked.begin(), blocked.end(), stage.name) == blocked.end() &&
                    has_work(stage, worker, now);
           });
  });
}

std::string World::stuck_reason(const JobState& job) const {
  std::string text = job.is_paused ? "paused;" : "";
  text += job.is_planned ? " planned;" : "";
  text += job.planning ? " planning;" : "";
  for (const StageState& stage : job.stages) {
    text += fmt::format(" {} {}/{} done, {} running, {} disputed, {} unconfirmed;",
                        to_string(stage.name), stage.done, stage.shards.size(), stage.running,
                        stage.disputed.size(), stage.unconfirmed());
  }
  for (const auto& [id, attempt] : coordinator_.queue()->attempts()) {
    const bool is_elsewhere = std::any_of(job.stages.begin(), job.stages.end(),
                                          [](const auto& stage) { return stage.elsewhere > 0; });
    if (attempt.job == job.id || is_elsewhere) {
      text += fmt::format(
          " attempt {} of {} for {:.3f} s more, without progress for {:.3f} s;", id, attempt.worker,
          std::chrono::duration<double>(attempt.lease_until - coordinator_.now()).count(),
          std::chrono::duration<double>(coordinator_.now() - attempt.progress_at).count());
    }
  }
  return text;
}

void World::check_progress() {
  const Queue* const queue = coordinator_.queue();
  if (queue == nullptr) {
    stuck_since_ms_.clear();
    return;
  }
  const std::uint64_t now_ms = ground_.timeline.now_ms();
  for (const JobState* const job : queue->jobs()) {
    if (job->has_ended()) {
      continue;
    }
    if (job->planning && !coordinator_.is_being_planned(*job)) {
      throw Violation(job->id + " waits for a plan that nobody makes");
    }
    if (job->phase == JobPhase::kCommitting && !coordinator_.is_being_committed(*job)) {
      throw Violation(job->id + " waits for its database, which nobody writes");
    }
    const bool moves = job->is_paused || job->planning || job->phase == JobPhase::kCommitting ||
                       std::any_of(job->stages.begin(), job->stages.end(),
                                   [](const StageState& stage) { return stage.running > 0; });
    if (moves || !could_run(*job)) {
      stuck_since_ms_.erase(job->id);
      continue;
    }
    const auto [since, is_new] = stuck_since_ms_.emplace(job->id, now_ms);
    if (now_ms - since->second > kStuckMs) {
      throw Violation(fmt::format("nobody works on {} for {} ms though somebody could:{}", job->id,
                                  now_ms - since->second, stuck_reason(*job)));
    }
  }
}

}  // namespace weft::simulation
