#include "cli/wanted_workers.h"

#include <algorithm>
#include <cmath>

namespace weft::cli {

namespace {

// Threads of the workers that run shards of a stage of this fabric.
double threads_at(std::span<const v1::Worker> workers, const v1::Job& job,
                  const v1::StageProgress& stage) {
  double threads = 0;
  for (const v1::Worker& worker : workers) {
    const auto runs_it = [&](const v1::WorkerAttempt& attempt) {
      return attempt.stage() == stage.name() && attempt.name().job_id() == job.id();
    };
    if (!worker.lost() &&
        std::any_of(worker.attempts().begin(), worker.attempts().end(), runs_it)) {
      threads += worker.threads();
    }
  }
  return threads;
}

}  // namespace

std::uint32_t wanted_workers(std::span<const v1::Job> unfinished,
                             std::span<const v1::Worker> workers, std::uint32_t now,
                             const ScaleLimits& limits) {
  const double threads_of_worker = std::max(1U, limits.threads);
  const double to_learn = std::max(1.0, 2.0 * now) * threads_of_worker;
  double threads = 0;
  for (const v1::Job& job : unfinished) {
    if (job.paused()) {
      continue;
    }
    // A job is planned by the numerics of the first worker that there is for it.
    threads += job.state() == v1::JOB_STATE_QUEUED ? 1 : 0;
    for (const v1::StageProgress& stage : job.stages()) {
      if (stage.state() != v1::STAGE_STATE_RUNNING || stage.shards_done() >= stage.shards()) {
        continue;
      }
      const auto left = static_cast<double>(stage.shards() - stage.shards_done());
      const double at_work = threads_at(workers, job, stage);
      threads += stage.seconds_left() > 0 && at_work > 0
                     ? std::min(left, stage.seconds_left() * at_work / limits.seconds_of_work)
                     : std::min(left, to_learn);
    }
  }
  const double wanted = std::ceil(threads / threads_of_worker);
  return static_cast<std::uint32_t>(
      std::clamp(wanted, static_cast<double>(limits.fewest), static_cast<double>(limits.most)));
}

}  // namespace weft::cli
