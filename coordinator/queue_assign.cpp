#include <algorithm>
#include <cmath>

#include "coordinator/queue.h"
#include "core/check.h"

// Which worker is given which run of shards.

namespace weft::coordinator {

namespace {

std::uint64_t ceil_div(std::uint64_t count, std::uint64_t divisor) {
  return (count + divisor - 1) / divisor;
}

}  // namespace

AssignAction Queue::describe(const Attempt& attempt) const {
  const JobState& job = *this->job(attempt.job);
  return {attempt.job,         job.stages[attempt.stage].name,
          attempt.id,          attempt.token,
          attempt.first_shard, attempt.shards,
          settings_.lease_ms,  attempt.purpose};
}

void Queue::assign(const ReportEvent& report, Time now, Actions& actions) {
  std::uint64_t held = 0;
  std::uint32_t free = report.free_attempts;
  // What the worker owns and did not list was in an answer that it never saw.
  for (const Attempt* const owned : attempts_of(report.worker)) {
    const Attempt& attempt = *owned;
    ++held;
    const bool is_listed =
        std::any_of(report.running.begin(), report.running.end(),
                    [&](const RunningClaim& claim) { return claim.attempt == attempt.id; });
    if (!is_listed) {
      actions.reply.assignments.push_back(describe(attempt));
      free -= free > 0 ? 1 : 0;
    }
  }
  const WorkerState& worker = workers_.at(report.worker);
  for (; free > 0; --free) {
    const std::optional<Run> run = next_run(worker, held > 0, now);
    if (!run) {
      return;
    }
    JobState& job = jobs_.at(run->job_order);
    StageState& stage = job.stages[run->stage];
    Attempt attempt;
    attempt.id = next_attempt_++;
    attempt.job = job.id;
    attempt.stage = run->stage;
    attempt.first_shard = run->first_shard;
    attempt.shards = run->shards;
    attempt.worker = worker.id;
    attempt.worker_name = worker.name;
    attempt.token = make_token(stage, run->first_shard, run->shards);
    for (std::uint64_t i = 0; i < run->shards; ++i) {
      stage.shards[run->first_shard + i] = ShardState::kRunning;
    }
    stage.running += run->shards;
    if (job.started_at == Time{}) {
      job.started_at = now;
    }
    job.phase = JobPhase::kRunning;
    ++job.revision;
    const Attempt& begun = begin_attempt(std::move(attempt), now);
    actions.attempts_begun.push_back(record_of(begun));
    actions.reply.assignments.push_back(describe(begun));
    ++held;
    if (stage.rate.empty()) {
      sample_rate(run->job_order, now);
    }
  }
}

std::optional<Queue::Run> Queue::next_run(const WorkerState& worker, bool is_busy, Time now) {
  if (drained_.contains(worker.name)) {
    return std::nullopt;
  }
  const auto blocked = blocked_.find(worker.name);
  for (auto& [order, job] : jobs_) {
    if (job.has_ended() || job.is_paused || job.fingerprint != worker.fingerprint) {
      continue;
    }
    for (std::size_t s = 0; s < job.stages.size(); ++s) {
      StageState& stage = job.stages[s];
      const auto backoff = stage.backoffs.find(worker.id);
      const bool must_wait = backoff != stage.backoffs.end() && now < backoff->second.until;
      const bool is_blocked = blocked != blocked_.end() && blocked->second.contains(stage.name);
      if (stage.pending() == 0 || must_wait || is_blocked) {
        continue;
      }
      const std::uint64_t size = run_size(job, stage, worker, is_busy, now);
      const std::optional<Run> run = size == 0 ? std::nullopt : run_of(order, s, worker, size, now);
      if (run) {
        return run;
      }
    }
  }
  return std::nullopt;
}

// The first shards in a row, at most `limit`, that this worker may run now. Shards that were with
// workers when those were lost come last, those with the fewest losses first: they may be the
// cause.
std::optional<Queue::Run> Queue::run_of(std::uint64_t order, std::size_t index,
                                        const WorkerState& worker, std::uint64_t limit, Time now) {
  StageState& stage = jobs_.at(order).stages[index];
  const std::uint64_t count = stage.shards.size();
  while (stage.first_pending < count && stage.shards[stage.first_pending] != ShardState::kPending) {
    ++stage.first_pending;
  }
  const auto may = [&](std::uint64_t shard) {
    return may_run(stage, {order, index, shard}, worker, now);
  };
  for (std::uint64_t i = stage.first_pending; i < count; ++i) {
    const auto trouble = stage.troubles.find(i);
    const bool has_trouble = trouble != stage.troubles.end();
    if ((has_trouble && trouble->second.losses > 0) || !may(i)) {
      continue;
    }
    Run run{order, index, i, 1};
    // A shard in trouble runs alone, so that it takes no other with it and is found out.
    while (!has_trouble && run.shards < limit && i + run.shards < count && may(i + run.shards) &&
           !stage.troubles.contains(i + run.shards)) {
      ++run.shards;
    }
    return run;
  }
  std::optional<Run> run;
  std::uint32_t fewest = ~std::uint32_t{0};
  for (const auto& [shard, trouble] : stage.troubles) {
    if (trouble.losses < fewest && may(shard)) {
      fewest = trouble.losses;
      run = Run{order, index, shard, 1};
    }
  }
  return run;
}

bool Queue::may_run(const StageState& stage, const ShardRef& ref, const WorkerState& worker,
                    Time now) const {
  if (stage.shards[ref.shard] != ShardState::kPending) {
    return false;
  }
  const auto same = unfinished_.find(stage.digests[ref.shard]);
  CHECK(same != unfinished_.end());
  for (const ShardRef& other : same->second) {
    const StageState& its_stage = jobs_.at(other.job_order).stages[other.stage];
    if (its_stage.shards[other.shard] == ShardState::kRunning) {
      return false;  // that run's result will be ours too
    }
  }
  const auto found = stage.troubles.find(ref.shard);
  if (found == stage.troubles.end()) {
    return true;
  }
  const ShardTrouble& trouble = found->second;
  if (now < trouble.retry_at) {
    return false;
  }
  // A shard that failed here is left to the others, if there are any where it did not.
  const bool failed_here = trouble.workers.contains(worker.id);
  return !failed_here || std::none_of(workers_.begin(), workers_.end(), [&](const auto& entry) {
    const auto backoff = stage.backoffs.find(entry.first);
    return is_live(entry.second, now) && entry.second.fingerprint == worker.fingerprint &&
           !trouble.workers.contains(entry.first) &&
           (backoff == stage.backoffs.end() || now >= backoff->second.until);
  });
}

// How many shards to give at once; 0: leave what there is to workers that have nothing.
std::uint64_t Queue::run_size(const JobState& job, const StageState& stage,
                              const WorkerState& worker, bool is_busy, Time now) const {
  std::uint64_t workers = 0;
  std::uint64_t idle = 0;  // of the others
  std::uint64_t idle_threads = 0;
  for (const auto& entry : workers_) {
    const WorkerState& other = entry.second;
    if (!is_live(other, now) || job.fingerprint != other.fingerprint) {
      continue;
    }
    ++workers;
    const bool has_attempt = attempts_of_worker_.contains(other.id);
    if (other.id != worker.id && !has_attempt) {
      ++idle;
      idle_threads += other.threads;
    }
  }
  CHECK_GT(workers, 0U);
  const std::uint64_t pending = stage.pending();
  if (is_busy && pending <= idle_threads) {
    return 0;
  }
  const std::uint64_t per_thread =
      std::min<std::uint64_t>(worker.threads, ceil_div(pending, 1 + idle));
  if (stage.shard_thread_ms <= 0) {
    return std::max<std::uint64_t>(per_thread, 1);  // the first runs of a stage measure it
  }
  const double per_ms = static_cast<double>(worker.threads) / stage.shard_thread_ms;
  const auto shards_in = [&](std::uint32_t ms) {
    const double shards = std::min(per_ms * ms, static_cast<double>(settings_.run_limit_shards));
    return static_cast<std::uint64_t>(shards);
  };
  // Large runs first, smaller ones towards the end, so that the workers end together.
  const std::uint64_t share = ceil_div(pending, 2 * workers);
  const std::uint64_t size = std::min(shards_in(settings_.target_run_ms),
                                      std::max(share, shards_in(settings_.shortest_run_ms)));
  return std::max<std::uint64_t>({size, per_thread, 1});
}

std::string Queue::waiting_for(const JobState& job, Time now) const {
  if (job.has_ended() || job.phase == JobPhase::kCommitting) {
    return "";
  }
  const bool any_live = std::any_of(workers_.begin(), workers_.end(),
                                    [&](const auto& w) { return is_live(w.second, now); });
  if (!any_live) {
    return "a worker: none is connected";
  }
  std::vector<const WorkerState*> able;
  for (const auto& [id, worker] : workers_) {
    if (is_live(worker, now) && job.fingerprint == worker.fingerprint) {
      able.push_back(&worker);
    }
  }
  if (job.fingerprint && able.empty()) {
    return "a worker whose numbers are equal to those the job began with (fingerprint " +
           job.fingerprint->hex().substr(0, 12) + ")";
  }
  for (const StageState& stage : job.stages) {
    if (stage.running > 0) {
      return "";
    }
    const bool all_short =
        !able.empty() && std::all_of(able.begin(), able.end(), [&](const WorkerState* worker) {
          const auto backoff = stage.backoffs.find(worker->id);
          return backoff != stage.backoffs.end() && now < backoff->second.until;
        });
    if (stage.pending() > 0 && all_short) {
      return std::string("memory, disk or files for ") + to_string(stage.name) +
             ", which are short on every worker";
    }
  }
  return "";
}

}  // namespace weft::coordinator
