#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// The life of an attempt: begun, renewed, ended.

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

AttemptRecord Queue::record_of(const Attempt& attempt) const {
  return {attempt.job,         attempt.id,      job(attempt.job)->stages[attempt.stage].name,
          attempt.first_shard, attempt.shards,  attempt.worker,
          attempt.worker_name, attempt.purpose, attempt.began_at.time_since_epoch().count()};
}

// The caller has taken its shards, and records it where it is new.
const Attempt& Queue::begin_attempt(Attempt attempt, Time now) {
  const std::uint64_t id = attempt.id;
  attempt.began_at = now;
  attempt.progress_at = now;
  attempt.lease_until = now + std::chrono::milliseconds(settings_.lease_ms);
  attempt.active_at = attempts_of_worker_.contains(attempt.worker) ? Time{} : now;
  find_job(attempt.job)->stages[attempt.stage].attempts.insert(id);
  leases_.emplace(attempt.lease_until, id);
  attempts_of_worker_[attempt.worker].insert(id);
  const auto worker = workers_.find(attempt.worker);
  if (worker != workers_.end()) {
    count(worker->second, now);
  }
  const auto [entry, is_new] = attempts_.emplace(id, std::move(attempt));
  CHECK(is_new);
  return entry->second;
}

// The attempt owns nothing any more; its shards are left to the caller.
Attempt Queue::end_attempt(std::uint64_t id, Outcome outcome, const std::string& message, Time now,
                           Actions& actions) {
  const auto entry = attempts_.find(id);
  CHECK(entry != attempts_.end());
  Attempt attempt = std::move(entry->second);
  attempts_.erase(entry);
  leases_.erase({attempt.lease_until, id});
  if (outcome != Outcome::kLost && id >> 32 < next_attempt_ >> 32) {
    ended_for_good_.insert(id);
  }
  slow_.erase(id);
  for (auto& [work, dispute] : disputes_) {
    dispute.attempt = dispute.attempt == id ? 0 : dispute.attempt;
  }
  find_job(attempt.job)->stages[attempt.stage].attempts.erase(id);
  const auto held = attempts_of_worker_.find(attempt.worker);
  held->second.erase(id);
  if (held->second.empty()) {
    attempts_of_worker_.erase(held);
  } else {
    Attempt& next = attempts_.at(*held->second.begin());
    next.active_at = next.active_at == Time{} ? now : next.active_at;
  }
  const auto worker = workers_.find(attempt.worker);
  if (worker != workers_.end()) {
    count(worker->second, now);
    if (outcome == Outcome::kStopped) {
      worker->second.settled.insert(id);  // people's order: its last report is no news
    }
  }
  actions.attempts_ended.push_back(
      {attempt.job, id, outcome, attempt.shards_done, message, now.time_since_epoch().count()});
  return attempt;
}

// Marks what the attempt is to do as being done, and says how many shards that are.
std::uint64_t Queue::take_shards(Attempt& attempt) {
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  const auto order = static_cast<std::uint32_t>(order_of_job_.at(job.id));
  const auto index = static_cast<std::uint32_t>(attempt.stage);
  const std::uint64_t end = attempt.first_shard + attempt.shards;
  std::uint64_t taken = 0;
  if (attempt.purpose != Purpose::kAudit) {
    stage.fresh.remove(attempt.first_shard, attempt.shards);
  }
  for (std::uint64_t shard = attempt.first_shard; shard < end; ++shard) {
    if (attempt.purpose == Purpose::kAudit) {
      taken += take_audit(stage, shard, attempt.id) ? 1 : 0;
    } else if (stage.shards[shard] == ShardState::kPending) {
      mark_running({shard, order, index});
      ++taken;
    } else if (stage.shards[shard] == ShardState::kRunning) {
      ++stage.doubled[shard];
      ++taken;
    } else if (stage.shards[shard] != ShardState::kDone) {
      attempt.skipped.insert(shard);
    }
  }
  return taken;
}

void Queue::renew(Attempt& attempt, Time now) {
  leases_.erase({attempt.lease_until, attempt.id});
  attempt.lease_until = now + std::chrono::milliseconds(settings_.lease_ms);
  leases_.emplace(attempt.lease_until, attempt.id);
}

void Queue::stop_attempts(JobState& job, Outcome outcome, const std::string& why, Time now,
                          Actions& actions) {
  for (std::size_t s = 0; s < job.stages.size(); ++s) {
    const std::set<std::uint64_t> attempts = job.stages[s].attempts;
    for (const std::uint64_t id : attempts) {
      const Attempt attempt = end_attempt(id, outcome, why, now, actions);
      release(attempt, attempt.losses, now);
    }
  }
}

void Queue::expire(Time now, Actions& actions) {
  while (!leases_.empty() && leases_.begin()->first < now) {
    lose(leases_.begin()->second, now, actions);
  }
}

}  // namespace weft::coordinator
