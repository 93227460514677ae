#include <algorithm>
#include <cstring>

#include "coordinator/queue/queue.h"
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

// Whether a claim, of either kind, is about this attempt.
template <class Claim>
bool is_about(const Attempt& attempt, const Claim& claim) {
  return attempt.job == claim.job && attempt.token == claim.token;
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
// what its token says. kNotYet: its stage is still to be planned, or planned again.
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
  const bool is_complete = job->is_planned && !job->planning &&
                           std::all_of(job->stages.begin(), job->stages.end(),
                                       [](const StageState& stage) { return stage.is_done(); });
  return is_complete ? Recognised::kNo : Recognised::kNotYet;
}

void Queue::on(const ReportEvent& event, Time now, Actions& actions) {
  expire(now, actions);
  enter(event, now, actions);
  for (const Attempt* const held : attempts_of(event.worker)) {
    const auto is_other_work = [&](const auto& claim) {
      return claim.attempt == held->id && !is_about(*held, claim);
    };
    // It was restored after a restart, and what its worker does was made of what proved to be
    // wrong.
    if (std::any_of(event.running.begin(), event.running.end(), is_other_work) ||
        std::any_of(event.completions.begin(), event.completions.end(), is_other_work)) {
      const Attempt ended = end_attempt(held->id, Outcome::kStopped,
                                        "what it was made of proved to be wrong", now, actions);
      release(ended, ended.losses, now);
      actions.wake = true;
    }
  }
  for (const CompletionClaim& claim : event.completions) {
    complete(event, claim, now, actions);
  }
  std::set<std::uint64_t> orders;
  std::set<std::uint64_t> named;
  const auto note = [&](const auto& claim) {
    named.insert(claim.attempt);
    const auto order = order_of_job_.find(claim.job);
    if (order != order_of_job_.end()) {
      orders.insert(order->second);
    }
  };
  for (const RunningClaim& claim : event.running) {
    keep(event, claim, now, actions);
    note(claim);
  }
  std::for_each(event.completions.begin(), event.completions.end(), note);
  std::erase_if(workers_.at(event.worker).settled,
                [&](std::uint64_t id) { return !named.contains(id); });
  if (event.leaving) {
    for (const Attempt* const held : attempts_of(event.worker)) {
      const Attempt attempt =
          end_attempt(held->id, Outcome::kStopped, "its worker left", now, actions);
      release(attempt, attempt.losses, now);
      actions.wake = true;
    }
    uncount(workers_.at(event.worker));
    workers_.erase(event.worker);
  } else {
    assign(event, now, actions);
  }
  for (const std::uint64_t order : orders) {
    sample_rate(order, now);
  }
}

// Takes over what the worker says of itself.
void Queue::enter(const ReportEvent& report, Time now, Actions& actions) {
  WorkerState& worker = workers_[report.worker];
  uncount(worker);
  const bool is_news = worker.id.empty() || !is_live(worker, now);
  worker.id = report.worker;
  worker.name = report.name;
  worker.threads = std::max(report.threads, 1U);
  worker.memory_bytes = report.memory_bytes;
  worker.fingerprint = report.fingerprint;
  worker.seen_at = now;
  worker.is_disconnected = false;
  worker.labels = report.labels;
  worker.wall_left_ms = report.wall_left_ms;
  worker.scenes = report.scenes;
  worker.undelivered = report.undelivered;
  count(worker, now);
  if (is_news) {
    bind_jobs(now, actions);
  }
}

void Queue::complete(const ReportEvent& report, const CompletionClaim& claim, Time now,
                     Actions& actions) {
  const auto live = attempts_.find(claim.attempt);
  // A worker that was started again brings what its forerunner had completed.
  const bool is_owner =
      live != attempts_.end() && is_about(live->second, claim) &&
      (live->second.worker == report.worker || live->second.worker_name == report.name);
  if (is_owner) {
    actions.reply.acknowledged.push_back({claim.job, claim.attempt});
    workers_.at(report.worker).settled.insert(claim.attempt);
    complete_own(report, claim, now, actions);
    return;
  }
  Attempt run;
  const Recognised recognised = recognise(claim.job, claim.attempt, claim.token, &run);
  if (recognised == Recognised::kNotYet) {
    return;  // it will be said again
  }
  actions.reply.acknowledged.push_back({claim.job, claim.attempt});
  if (recognised == Recognised::kYes) {
    lost_.erase(claim.attempt);
    JobState& job = *find_job(claim.job);
    count_superseded(report, claim.job, claim.attempt);
    job.superseded_results_used += take_results(job, run, claim, report, now, actions);
  }
}

void Queue::complete_own(const ReportEvent& report, const CompletionClaim& claim, Time now,
                         Actions& actions) {
  attempts_.at(claim.attempt).shards_done = claim.results.size();
  const Attempt attempt =
      end_attempt(claim.attempt, claim.failure ? Outcome::kFailed : Outcome::kSucceeded,
                  claim.failure ? claim.failure->message : "", now, actions);
  JobState& job = *find_job(attempt.job);
  const std::uint32_t generation = job.generation;
  measure(attempt, claim, report.threads);
  take_results(job, attempt, claim, report, now, actions);
  if (job.has_ended() || job.generation != generation) {
    return;
  }
  release(attempt, attempt.losses, now);
  StageState& stage = job.stages[attempt.stage];
  if (stage.pending() > 0) {
    actions.wake = true;
  }
  if (!claim.results.empty()) {
    const auto backoff = stage.backoffs.find(report.worker);
    if (backoff != stage.backoffs.end()) {
      backoff->second.failures = 0;
    }
  }
  if (!claim.failure) {
    if (!claim.results.empty()) {
      stage.backoffs.erase(report.worker);
    }
  } else if (claim.failure->resource_short) {
    short_of_resource(attempt, report.worker, now);
  } else {
    ++workers_.at(report.worker).failures;
    note_failure(stage, report.worker, now);
    const std::uint64_t shard = claim.failure->shard;
    const bool is_of_run =
        shard >= attempt.first_shard && shard - attempt.first_shard < attempt.shards;
    fail_shard(attempt, is_of_run ? shard : attempt.first_shard, claim.failure->message,
               TroubleKind::kFailed, now, actions);
  }
}

// Learns from a completion how long shards take, and corrects what its job was charged.
void Queue::measure(const Attempt& attempt, const CompletionClaim& claim, std::uint32_t threads) {
  if (claim.results.empty() || claim.work_ms == 0) {
    return;
  }
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  const auto shards = static_cast<double>(claim.results.size());
  const double busy = std::min(static_cast<double>(std::max(threads, 1U)), shards);
  const double work_ms = static_cast<double>(claim.work_ms) * busy;
  const double measured = work_ms / shards;
  stage.shard_thread_ms =
      stage.shard_thread_ms == 0 ? measured : 0.5 * (stage.shard_thread_ms + measured);
  shares_.correct(job.demands.user, job.id, work_ms - attempt.charged_ms);
}

// Takes the results of unfinished shards, whoever brings them, and compares the others with what is
// recorded. Says how many it took. The job may end, or begin again.
std::uint64_t Queue::take_results(JobState& job, const Attempt& run, const CompletionClaim& claim,
                                  const ReportEvent& report, Time now, Actions& actions) {
  const StageName name = job.stages[run.stage].name;
  if (claim.results.empty() || is_liar(report.name, name)) {
    return 0;
  }
  const std::uint32_t generation = job.generation;
  std::uint64_t taken = 0;
  for (const ShardResult& result : claim.results) {
    if (job.has_ended() || job.generation != generation) {
      break;
    }
    const StageState& stage = job.stages[run.stage];
    if (result.shard < run.first_shard || result.shard - run.first_shard >= run.shards) {
      continue;
    }
    if (stage.shards[result.shard] == ShardState::kDone) {
      compare(job, run.stage, result.shard, {report.name, result.digest, result.size_bytes}, now,
              actions);
      continue;
    }
    ++taken;
    const core::Digest work = stage.digests[result.shard];
    actions.results.push_back({work, result.digest, result.size_bytes, report.name});
    finish_shard(work, result.digest, report.name, now, actions);
  }
  workers_.at(report.worker).shards_done += taken;
  if (taken > 0) {
    conduct_[{report.name, name}].passed += taken;
    passed_at_[report.name] = now;
  }
  return taken;
}

// An attempt of which a worker reports is no longer its own: counted once.
void Queue::count_superseded(const ReportEvent& report, const std::string& job,
                             std::uint64_t attempt) {
  WorkerState& worker = workers_.at(report.worker);
  if (worker.settled.insert(attempt).second) {
    ++worker.superseded;
    ++find_job(job)->superseded_attempts;
    ++find_job(job)->revision;
  }
}

void Queue::keep(const ReportEvent& report, const RunningClaim& claim, Time now, Actions& actions) {
  const auto live = attempts_.find(claim.attempt);
  const bool is_owner = live != attempts_.end() && is_about(live->second, claim) &&
                        live->second.worker == report.worker;
  if (!is_owner) {
    Attempt run;
    const Recognised recognised = recognise(claim.job, claim.attempt, claim.token, &run);
    // An attempt of before a restart may be restored when its stage is planned.
    const bool may_be_restored = claim.attempt >> 32 < next_attempt_ >> 32;
    const JobState* const job = find_job(claim.job);
    if (recognised == Recognised::kNotYet && !job->is_paused &&
        (job->planning || may_be_restored)) {
      return;  // neither renewed nor stopped: its worker goes on while its lease lasts
    }
    const bool is_adopted =
        recognised == Recognised::kYes && adopt(run, report.worker, now, actions);
    if (!is_adopted) {
      if (recognised == Recognised::kYes) {
        count_superseded(report, claim.job, claim.attempt);
      } else if (recognised == Recognised::kNotYet && may_be_restored) {
        // Its job is paused. It shall not be restored when its stage is planned after that.
        actions.attempts_ended.push_back({claim.job, claim.attempt, Outcome::kStopped,
                                          claim.shards_done, "its job was paused",
                                          now.time_since_epoch().count()});
      }
      actions.reply.stop.push_back({claim.job, claim.attempt});
      return;
    }
  }
  Attempt& attempt = attempts_.at(claim.attempt);
  if (!is_needed(attempt)) {
    actions.reply.stop.push_back({claim.job, claim.attempt});
    const Attempt ended = end_attempt(claim.attempt, Outcome::kSuperseded,
                                      "others brought its results", now, actions);
    release(ended, ended.losses, now);
    return;
  }
  renew(attempt, now);
  if (attempt.shards_done != claim.shards_done || attempt.last_line != claim.last_line) {
    ++find_job(attempt.job)->revision;
  }
  if (attempt.shards_done != claim.shards_done || attempt.progress != claim.progress) {
    attempt.progress_at = now;
  }
  if (!report.undelivered.empty()) {  // it waits for us: that time does not count
    attempt.progress_at = now;
    attempt.active_at = attempt.active_at == Time{} ? Time{} : now;
  }
  attempt.shards_done = claim.shards_done;
  attempt.progress = claim.progress;
  attempt.last_line = claim.last_line;
  actions.reply.leases.push_back({claim.job, claim.attempt});
}

// Whether something of it is still to be done.
bool Queue::is_needed(const Attempt& attempt) const {
  const StageState& stage = job(attempt.job)->stages[attempt.stage];
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    const std::uint64_t shard = attempt.first_shard + i;
    const bool is_open =
        attempt.purpose == Purpose::kAudit
            ? stage.auditing.contains(shard) || stage.disputed.contains(shard)
            : stage.shards[shard] == ShardState::kRunning && !attempt.skipped.contains(shard);
    if (is_open) {
      return true;
    }
  }
  return false;
}

// Takes back an attempt that an earlier epoch gave out, or whose worker had fallen silent, if
// nobody else has begun any of its shards.
bool Queue::adopt(const Attempt& run, const std::string& worker, Time now, Actions& actions) {
  const auto lost = lost_.find(run.id);
  const bool was_lost = lost != lost_.end() && lost->second.worker == worker;
  const bool is_older = run.id >> 32 < next_attempt_ >> 32 && !ended_for_good_.contains(run.id);
  JobState& job = *find_job(run.job);
  StageState& stage = job.stages[run.stage];
  if ((!was_lost && !is_older) || attempts_.contains(run.id) || job.is_paused ||
      job.fingerprint != workers_.at(worker).fingerprint) {
    return false;
  }
  const std::uint64_t end = run.first_shard + run.shards;
  std::uint64_t pending = 0;
  for (std::uint64_t i = run.first_shard; i < end; ++i) {
    if (stage.shards[i] != ShardState::kPending && stage.shards[i] != ShardState::kDone) {
      return false;
    }
    pending += stage.shards[i] == ShardState::kPending ? 1 : 0;
  }
  if (pending == 0) {
    return false;
  }
  Attempt attempt = run;
  attempt.worker = worker;
  attempt.worker_name = workers_.at(worker).name;
  if (was_lost && run.shards == 1) {
    absolve(stage, run.first_shard, attempt.worker_name);
  }
  if (was_lost) {
    deaths_.take_back(attempt.worker_name, worker);
  }
  lost_.erase(run.id);
  take_shards(attempt);
  const Attempt& begun = begin_attempt(std::move(attempt), now);
  const auto its_end = [&](const AttemptEndRecord& record) { return record.attempt == begun.id; };
  if (std::erase_if(actions.attempts_ended, its_end) == 0) {  // else it goes on as if never lost
    actions.attempts_begun.push_back(record_of(begun));
  }
  job.phase = JobPhase::kRunning;
  if (job.started_at == Time{}) {
    job.started_at = now;
  }
  ++job.revision;
  refresh(job, now);
  return true;
}

}  // namespace weft::coordinator
