#include "coordinator/queue.h"
#include "core/check.h"

// The life of an attempt: given, renewed, ended, and given back to its worker after a restart.

namespace weft::coordinator {

std::vector<const Attempt*> Queue::attempts_of(const std::string& worker_id) const {
  std::vector<const Attempt*> attempts;
  const auto held = attempts_of_worker_.find(worker_id);
  if (held != attempts_of_worker_.end()) {
    for (const std::uint64_t id : held->second) {
      attempts.push_back(&attempts_.at(id));
    }
  }
  return attempts;
}

// The caller marks its shards as running, and records it where it is new.
const Attempt& Queue::begin_attempt(Attempt attempt, Time now) {
  const std::uint64_t id = attempt.id;
  attempt.began_at = now;
  attempt.progress_at = now;
  attempt.lease_until = now + std::chrono::milliseconds(settings_.lease_ms);
  find_job(attempt.job)->stages[attempt.stage].attempts.insert(id);
  leases_.emplace(attempt.lease_until, id);
  attempts_of_worker_[attempt.worker].insert(id);
  const auto [entry, is_new] = attempts_.emplace(id, std::move(attempt));
  CHECK(is_new);
  return entry->second;
}

AttemptRecord Queue::record_of(const Attempt& attempt) const {
  return {attempt.job,         attempt.id,      job(attempt.job)->stages[attempt.stage].name,
          attempt.first_shard, attempt.shards,  attempt.worker,
          attempt.worker_name, attempt.purpose, attempt.began_at.time_since_epoch().count()};
}

// The attempt owns nothing any more; its shards are left to the caller.
Attempt Queue::end_attempt(std::uint64_t id, Outcome outcome, const std::string& message, Time now,
                           Actions& actions) {
  const auto entry = attempts_.find(id);
  CHECK(entry != attempts_.end());
  Attempt attempt = std::move(entry->second);
  attempts_.erase(entry);
  leases_.erase({attempt.lease_until, id});
  find_job(attempt.job)->stages[attempt.stage].attempts.erase(id);
  const auto held = attempts_of_worker_.find(attempt.worker);
  held->second.erase(id);
  if (held->second.empty()) {
    attempts_of_worker_.erase(held);
  }
  actions.attempts_ended.push_back(
      {attempt.job, id, outcome, attempt.shards_done, message, now.time_since_epoch().count()});
  return attempt;
}

void Queue::renew(Attempt& attempt, Time now) {
  leases_.erase({attempt.lease_until, attempt.id});
  attempt.lease_until = now + std::chrono::milliseconds(settings_.lease_ms);
  leases_.emplace(attempt.lease_until, attempt.id);
}

// What ran before a restart goes on: its worker owns it for one lease, and longer if it comes back.
void Queue::restore(const JobState& job, std::size_t index, const PriorAttempt& prior, Time now,
                    Actions& actions) {
  StageState& stage = find_job(job.id)->stages[index];
  const std::uint64_t count = stage.shards.size();
  const bool is_prior = prior.id >> 32 < next_attempt_ >> 32 && !attempts_.contains(prior.id);
  const bool fits = prior.first_shard < count && prior.shards <= count - prior.first_shard;
  if (!is_prior || !fits) {
    return;
  }
  const std::uint64_t end = prior.first_shard + prior.shards;
  std::uint64_t taken = 0;
  for (std::uint64_t shard = prior.first_shard; shard < end; ++shard) {
    if (stage.shards[shard] == ShardState::kPending && !job.is_paused) {
      stage.shards[shard] = ShardState::kRunning;
      ++taken;
    }
  }
  if (taken == 0) {
    actions.attempts_ended.push_back(
        {job.id, prior.id, job.is_paused ? Outcome::kStopped : Outcome::kSuperseded, 0,
         job.is_paused ? "its job was paused" : "others brought its results",
         now.time_since_epoch().count()});
    return;
  }
  stage.running += taken;
  Attempt attempt;
  attempt.id = prior.id;
  attempt.job = job.id;
  attempt.stage = index;
  attempt.first_shard = prior.first_shard;
  attempt.shards = prior.shards;
  attempt.worker = prior.worker;
  attempt.worker_name = prior.worker_name;
  attempt.purpose = prior.purpose;
  attempt.token = make_token(stage, prior.first_shard, prior.shards);
  begin_attempt(std::move(attempt), now);
}

}  // namespace weft::coordinator
