#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Workers: who is there, who may run what, and why not.

namespace weft::coordinator {

namespace {

// A run is expected to end before its worker must when it has this much time for it.
constexpr double kWallSafety = 1.25;

}  // namespace

bool Queue::is_live(const WorkerState& worker, Time now) const {
  return !worker.is_disconnected &&
         now - worker.seen_at <= std::chrono::milliseconds(settings_.lease_ms);
}

void Queue::uncount(WorkerState& worker) {
  if (!worker.is_counted) {
    return;
  }
  const auto pool = pools_.find(worker.fingerprint);
  CHECK(pool != pools_.end());
  --pool->second.workers;
  if (worker.is_counted_idle) {
    --pool->second.idle;
    pool->second.idle_threads -= worker.threads;
  }
  if (pool->second.workers == 0) {
    pools_.erase(pool);
  }
  worker.is_counted = false;
  worker.is_counted_idle = false;
}

void Queue::count(WorkerState& worker, Time now) {
  uncount(worker);
  if (!is_live(worker, now) || drained_.contains(worker.name)) {
    return;
  }
  WorkerPool& pool = pools_[worker.fingerprint];
  ++pool.workers;
  worker.is_counted = true;
  if (!attempts_of_worker_.contains(worker.id)) {
    ++pool.idle;
    pool.idle_threads += worker.threads;
    worker.is_counted_idle = true;
  }
}

bool Queue::is_liar(const std::string& worker_name, StageName stage) const {
  const auto blocked = blocked_.find(worker_name);
  if (blocked == blocked_.end()) {
    return false;
  }
  const auto kind = blocked->second.find(stage);
  return kind != blocked->second.end() && kind->second;
}

// What a worker runs needs memory once for each stage that it runs something of.
bool Queue::lacks_memory(const WorkerState& worker, const StageState& stage) const {
  if (worker.memory_bytes == 0 || stage.memory_bytes == 0) {
    return false;
  }
  std::set<const StageState*> held;
  for (const Attempt* const attempt : attempts_of(worker.id)) {
    held.insert(&this->job(attempt->job)->stages[attempt->stage]);
  }
  held.insert(&stage);
  std::uint64_t bytes = 0;
  for (const StageState* const one : held) {
    bytes += one->memory_bytes;
  }
  return bytes > worker.memory_bytes;
}

// How much of a worker's time is left when it has done what it holds.
double Queue::wall_left_ms(const WorkerState& worker, Time now) const {
  double left_ms = static_cast<double>(worker.wall_left_ms) -
                   static_cast<double>((now - worker.seen_at).count());
  for (const Attempt* const attempt : attempts_of(worker.id)) {
    const StageState& stage = job(attempt->job)->stages[attempt->stage];
    left_ms -= expected_ms(stage, attempt->shards, worker.threads);
  }
  return left_ms / kWallSafety;
}

double Queue::expected_ms(const StageState& stage, std::uint64_t shards, std::uint32_t threads) {
  const auto count = static_cast<double>(shards);
  return stage.shard_thread_ms * count / std::clamp(static_cast<double>(threads), 1.0, count);
}

Hindrance Queue::hindrance(const WorkerState& worker, const JobState& job, const StageState& stage,
                           Time now) const {
  if (!is_live(worker, now)) {
    return {Obstacle::kLost, {}};
  }
  if (job.fingerprint != worker.fingerprint) {
    return {Obstacle::kFingerprint, {}};
  }
  const bool has_labels = std::all_of(
      job.demands.labels.begin(), job.demands.labels.end(), [&](const std::string& label) {
        return std::find(worker.labels.begin(), worker.labels.end(), label) != worker.labels.end();
      });
  if (!has_labels) {
    return {Obstacle::kLabels, {}};
  }
  if (worker.memory_bytes != 0 && stage.memory_bytes > worker.memory_bytes) {
    return {Obstacle::kMemory, {}};
  }
  if (drained_.contains(worker.name)) {
    return {Obstacle::kDrained, {}};
  }
  const auto blocked = blocked_.find(worker.name);
  if (blocked != blocked_.end() && blocked->second.contains(stage.name)) {
    return {Obstacle::kBlocked, {}};
  }
  const auto backoff = stage.backoffs.find(worker.id);
  if (backoff != stage.backoffs.end() && now < backoff->second.until) {
    return {backoff->second.is_short ? Obstacle::kShort : Obstacle::kFailing,
            backoff->second.until};
  }
  if (!worker.undelivered.empty()) {
    return {Obstacle::kShort, {}};
  }
  if (lacks_memory(worker, stage)) {
    return {Obstacle::kMemoryHeld, {}};
  }
  if (worker.wall_left_ms != 0) {
    const double needed_ms =
        stage.shard_thread_ms > 0 ? stage.shard_thread_ms : settings_.wall_margin_ms;
    if (wall_left_ms(worker, now) < needed_ms) {
      return {Obstacle::kWallTime, {}};
    }
  }
  return {};
}

std::set<std::string> Queue::eligible(const JobState& job, const StageState& stage,
                                      Time now) const {
  std::set<std::string> names;
  for (const auto& [id, worker] : workers_) {
    const Obstacle obstacle = hindrance(worker, job, stage, now).obstacle;
    if (obstacle == Obstacle::kNone || obstacle >= Obstacle::kShort) {
      names.insert(worker.name);
    }
  }
  return names;
}

bool Queue::is_left_to_others(const JobState& job, const StageState& stage,
                              const ShardTrouble& trouble, const WorkerState& worker,
                              Time now) const {
  return trouble.failures.contains(worker.name) &&
         std::any_of(workers_.begin(), workers_.end(), [&](const auto& entry) {
           const Obstacle obstacle = hindrance(entry.second, job, stage, now).obstacle;
           const bool can_soon = obstacle == Obstacle::kNone || obstacle == Obstacle::kMemoryHeld;
           return can_soon && !trouble.failures.contains(entry.second.name);
         });
}

}  // namespace weft::coordinator
