#include <algorithm>
#include <cstring>

#include "coordinator/queue.h"
#include "core/check.h"

// What workers say: completions, and what they still run.

namespace weft::coordinator {

namespace {

constexpr std::size_t kTokenBytes = 1 + 8 + 8 + 32;

core::Digest digest_of_run(const StageState& stage, std::uint64_t first, std::uint64_t count) {
  core::Hasher hasher;
  for (std::uint64_t i = first; i < first + count; ++i) {
    hasher.bytes(stage.digests[i].binary());
  }
  return hasher.finish();
}

void put_number(std::string& bytes, std::uint64_t value) {
  for (unsigned shift = 0; shift < 64; shift += 8) {
    bytes.push_back(static_cast<char>(value >> shift & 0xff));
  }
}

std::uint64_t number_at(const std::string& bytes, std::size_t offset) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    value |= static_cast<std::uint64_t>(static_cast<std::uint8_t>(bytes[offset + i])) << (8 * i);
  }
  return value;
}

// Whether a worker's claim, of either kind, is about an attempt that it owns.
template <class Claim>
bool owns(const std::string& worker, const Attempt& attempt, const Claim& claim) {
  return attempt.worker == worker && attempt.job == claim.job && attempt.token == claim.token;
}

}  // namespace

std::string Queue::make_token(const StageState& stage, std::uint64_t first,
                              std::uint64_t count) const {
  std::string token(1, static_cast<char>(stage.name));
  put_number(token, first);
  put_number(token, count);
  return token + digest_of_run(stage, first, count).binary();
}

// Finds what an attempt runs that owns nothing (any more, or since the coordinator's restart) from
// what its token says. kNotYet: its job is still being planned.
Queue::Recognised Queue::recognise(const std::string& job_id, std::uint64_t attempt,
                                   const std::string& token, Attempt* run) {
  const JobState* const job = find_job(job_id);
  if (job == nullptr || job->has_ended() || token.size() != kTokenBytes) {
    return Recognised::kNo;
  }
  for (std::size_t s = 0; s < job->stages.size(); ++s) {
    const StageState& stage = job->stages[s];
    if (static_cast<char>(stage.name) != token[0]) {
      continue;
    }
    const std::uint64_t first = number_at(token, 1);
    const std::uint64_t count = number_at(token, 9);
    const bool fits = first < stage.shards.size() && count <= stage.shards.size() - first &&
                      count > 0 && count <= settings_.run_limit_shards &&
                      make_token(stage, first, count) == token;
    if (!fits) {
      return Recognised::kNo;
    }
    run->id = attempt;
    run->job = job_id;
    run->stage = s;
    run->first_shard = first;
    run->shards = count;
    run->token = token;
    return Recognised::kYes;
  }
  return job->planning || !job->fingerprint ? Recognised::kNotYet : Recognised::kNo;
}

void Queue::on(const ReportEvent& event, Time now, Actions& actions) {
  expire(now, actions);
  WorkerState& worker = workers_[event.worker];
  worker.id = event.worker;
  worker.name = event.name;
  worker.threads = std::max(event.threads, 1U);
  worker.memory_bytes = event.memory_bytes;
  worker.fingerprint = event.fingerprint;
  worker.seen_at = now;
  worker.labels = event.labels;
  worker.wall_left_ms = event.wall_left_ms;
  worker.scenes = event.scenes;
  bind_jobs(now, actions);

  for (const CompletionClaim& claim : event.completions) {
    complete(event, claim, now, actions);
  }
  std::set<std::uint64_t> orders;
  for (const RunningClaim& claim : event.running) {
    keep(event, claim, now, actions);
    const auto order = order_of_job_.find(claim.job);
    if (order != order_of_job_.end()) {
      orders.insert(order->second);
    }
  }
  for (const CompletionClaim& claim : event.completions) {
    const auto order = order_of_job_.find(claim.job);
    if (order != order_of_job_.end()) {
      orders.insert(order->second);
    }
  }
  if (event.leaving) {
    for (const Attempt* const attempt : attempts_of(event.worker)) {
      release(end_attempt(attempt->id, Outcome::kStopped, "its worker left", now, actions));
      actions.wake = true;
    }
    workers_.erase(event.worker);
  } else {
    assign(event, now, actions);
  }
  for (const std::uint64_t order : orders) {
    sample_rate(order, now);
  }
}

void Queue::complete(const ReportEvent& report, const CompletionClaim& claim, Time now,
                     Actions& actions) {
  const auto live = attempts_.find(claim.attempt);
  const bool is_owner = live != attempts_.end() && owns(report.worker, live->second, claim);
  if (!is_owner) {
    Attempt run;
    const Recognised recognised = recognise(claim.job, claim.attempt, claim.token, &run);
    if (recognised == Recognised::kNotYet) {
      return;  // it will be said again
    }
    actions.reply.acknowledged.push_back({claim.job, claim.attempt});
    if (recognised == Recognised::kYes) {
      take_results(*find_job(claim.job), run, claim, report.worker, now, actions);
    }
    return;
  }

  actions.reply.acknowledged.push_back({claim.job, claim.attempt});
  live->second.shards_done = claim.results.size();
  const Attempt attempt =
      end_attempt(claim.attempt, claim.failure ? Outcome::kFailed : Outcome::kSucceeded,
                  claim.failure ? claim.failure->message : "", now, actions);
  JobState& job = *find_job(attempt.job);
  take_results(job, attempt, claim, report.worker, now, actions);
  StageState& stage = job.stages[attempt.stage];
  if (!claim.results.empty() && claim.work_ms > 0) {
    const auto shards = static_cast<double>(claim.results.size());
    const double busy = std::min(static_cast<double>(std::max(report.threads, 1U)), shards);
    const double measured = static_cast<double>(claim.work_ms) * busy / shards;
    stage.shard_thread_ms =
        stage.shard_thread_ms == 0 ? measured : 0.5 * (stage.shard_thread_ms + measured);
  }
  release(attempt);
  if (stage.pending() > 0) {
    actions.wake = true;
  }
  if (!claim.failure) {
    if (!claim.results.empty()) {
      stage.backoffs.erase(report.worker);
    }
  } else if (claim.failure->resource_short) {
    back_off(attempt, report.worker, now);
  } else {
    ++workers_[report.worker].failures;
    fail_shard(attempt, *claim.failure, now, actions);
  }
}

// Takes the results of unfinished shards, whoever brings them.
void Queue::take_results(const JobState& job, const Attempt& run, const CompletionClaim& claim,
                         const std::string& worker, Time now, Actions& actions) {
  const StageState& stage = job.stages[run.stage];
  for (const ShardResult& result : claim.results) {
    const bool is_of_run =
        result.shard >= run.first_shard && result.shard - run.first_shard < run.shards;
    if (!is_of_run || stage.shards[result.shard] == ShardState::kDone) {
      continue;
    }
    ++workers_[worker].shards_done;
    const core::Digest work = stage.digests[result.shard];
    actions.results.push_back({work, result.digest, result.size_bytes, workers_[worker].name});
    finish_shard(work, result.digest, now, actions);
  }
}

void Queue::keep(const ReportEvent& report, const RunningClaim& claim, Time now, Actions& actions) {
  const auto live = attempts_.find(claim.attempt);
  const bool is_owner = live != attempts_.end() && owns(report.worker, live->second, claim);
  if (!is_owner) {
    Attempt run;
    const Recognised recognised = recognise(claim.job, claim.attempt, claim.token, &run);
    if (recognised == Recognised::kNotYet) {
      return;  // neither renewed nor stopped: its worker goes on while its lease lasts
    }
    const bool is_adopted =
        recognised == Recognised::kYes && adopt(run, report.worker, now, actions);
    if (!is_adopted) {
      actions.reply.stop.push_back({claim.job, claim.attempt});
      return;
    }
  }
  Attempt& attempt = attempts_.at(claim.attempt);
  const StageState& stage = find_job(attempt.job)->stages[attempt.stage];
  bool has_work = false;
  for (std::uint64_t i = 0; i < attempt.shards && !has_work; ++i) {
    has_work = stage.shards[attempt.first_shard + i] == ShardState::kRunning;
  }
  if (!has_work) {  // others brought all of its results
    actions.reply.stop.push_back({claim.job, claim.attempt});
    end_attempt(claim.attempt, Outcome::kSuperseded, "others brought its results", now, actions);
    return;
  }
  renew(attempt, now);
  if (attempt.shards_done != claim.shards_done || attempt.last_line != claim.last_line) {
    ++find_job(attempt.job)->revision;
  }
  if (attempt.shards_done != claim.shards_done || attempt.progress != claim.progress) {
    attempt.progress_at = now;
  }
  attempt.shards_done = claim.shards_done;
  attempt.progress = claim.progress;
  attempt.last_line = claim.last_line;
  actions.reply.leases.push_back({claim.job, claim.attempt});
}

// Takes back an attempt that an earlier epoch gave out, if nobody else runs any of its shards.
bool Queue::adopt(const Attempt& run, const std::string& worker, Time now, Actions& actions) {
  const std::uint64_t epoch = next_attempt_ >> 32;
  JobState& job = *find_job(run.job);
  StageState& stage = job.stages[run.stage];
  if (run.id >> 32 >= epoch || job.is_paused ||
      job.fingerprint != workers_.at(worker).fingerprint) {
    return false;
  }
  std::uint64_t pending = 0;
  for (std::uint64_t i = run.first_shard; i < run.first_shard + run.shards; ++i) {
    if (stage.shards[i] == ShardState::kRunning) {
      return false;
    }
    pending += stage.shards[i] == ShardState::kPending ? 1 : 0;
  }
  if (pending == 0) {
    return false;
  }
  for (std::uint64_t i = run.first_shard; i < run.first_shard + run.shards; ++i) {
    if (stage.shards[i] == ShardState::kPending) {
      stage.shards[i] = ShardState::kRunning;
      ++stage.running;
    }
  }
  Attempt attempt = run;
  attempt.worker = worker;
  attempt.worker_name = workers_.at(worker).name;
  actions.attempts_begun.push_back(record_of(begin_attempt(std::move(attempt), now)));
  job.phase = JobPhase::kRunning;
  if (job.started_at == Time{}) {
    job.started_at = now;
  }
  ++job.revision;
  return true;
}

}  // namespace weft::coordinator
