#include "coordinator/scheduler/census.h"

namespace weft::coordinator {

namespace {

constexpr double kMsPerSecond = 1000;

void count_job(const JobState& job, Census& census) {
  census.jobs_queued += job.phase == JobPhase::kQueued ? 1 : 0;
  census.jobs_running += job.phase == JobPhase::kRunning ? 1 : 0;
  census.jobs_committing += job.phase == JobPhase::kCommitting ? 1 : 0;
  census.jobs_paused += job.is_paused ? 1 : 0;
  for (const StageState& stage : job.stages) {
    Census::Shards& shards = census.shards[stage.name];
    const std::uint64_t unconfirmed = stage.unconfirmed();
    shards.waiting += stage.pending();
    shards.running += stage.running;
    shards.done += stage.done;
    shards.quarantined += stage.quarantined;
    shards.awaiting_audit += unconfirmed;
    if (!job.is_paused) {
      census.runnable_shards += stage.pending() + stage.running + unconfirmed;
      census.work_seconds +=
          static_cast<double>(stage.pending() + unconfirmed) * stage.shard_thread_ms / kMsPerSecond;
    }
  }
}

void count_worker(const Queue& queue, const WorkerState& worker, Time now, Census& census) {
  if (!queue.is_live(worker, now)) {
    ++census.workers_lost;
    return;
  }
  ++census.workers_live;
  census.threads += worker.threads;
  census.workers_idle += queue.attempts_of(worker.id).empty() ? 1 : 0;
  census.workers_drained += queue.is_drained(worker.name) ? 1 : 0;
  census.workers_blocked += queue.blocked_stages(worker.name).empty() ? 0 : 1;
}

}  // namespace

Census census_of(const Queue& queue, Time now) {
  Census census;
  for (const StageName stage : all_stages()) {
    census.shards[stage] = {};
  }
  for (const JobState* job : queue.jobs()) {
    if (!job->has_ended()) {
      count_job(*job, census);
    }
  }
  for (const auto& [id, worker] : queue.workers()) {
    count_worker(queue, worker, now, census);
  }
  return census;
}

}  // namespace weft::coordinator
