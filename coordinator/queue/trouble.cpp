#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Failures, losses and hangs, and what follows from them: a retry, a shard that is given up, a
// worker that is blocked.

namespace weft::coordinator {

namespace {

constexpr const char* kHung = "it hung: its progress stood still";
constexpr std::uint32_t kDoublings = 10;

std::string in_words(const StageState& stage, std::uint64_t shard) {
  return std::string(to_string(stage.name)) + " shard " + std::to_string(shard) + " of " +
         std::to_string(stage.shards.size());
}

// After a further loss of a run of so many shards: how often it counts as lost, which says how
// short the next runs are. These are shorter than the one that was lost.
std::size_t losses_after(std::size_t losses, std::uint64_t shards) {
  do {
    ++losses;
  } while (losses < kSuspectRunShards.size() && kSuspectRunShards[losses - 1] >= shards);
  return std::min(losses, kSuspectRunShards.size());
}

}  // namespace

// The attempt's worker is gone: its shards go back. One that loses worker after worker while it
// runs alone is taken for the cause.
void Queue::lose(std::uint64_t id, Time now, Actions& actions) {
  if (!attempts_.contains(id)) {
    return;  // losing another one ended its job
  }
  const Attempt attempt = end_attempt(id, Outcome::kLost, "its worker fell silent", now, actions);
  actions.wake = true;
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  if (attempt.purpose == Purpose::kAudit) {
    release(attempt, 0, now);
    audit_not_done(attempt, attempt.first_shard, now, actions);
    return;
  }
  lost_[id] = {attempt.worker, now};
  deaths_.add(attempt.worker_name, attempt.worker, now,
              {job.id, stage.name, attempt.first_shard, attempt.shards});
  const std::uint64_t shard = attempt.first_shard;
  const bool is_alone = attempt.shards == 1 && stage.shards[shard] == ShardState::kRunning &&
                        !stage.doubled.contains(shard);
  if (is_alone) {
    LoneLoss loss{attempt.worker_name, now, false};
    loss.is_confirmed = survives(loss);
    ShardTrouble& trouble = stage.troubles[shard];
    trouble.lone_losses.push_back(std::move(loss));
    trouble.last_attempt = id;
    actions.failures.push_back({job.id, stage.name, shard, attempt.worker_name,
                                "its worker fell silent", TroubleKind::kLoneLoss});
  }
  const std::size_t losses = losses_after(attempt.losses, attempt.shards);
  release(attempt, losses, now);
  const bool is_short_run = !is_alone && losses == kSuspectRunShards.size();
  for (std::uint64_t i = shard; is_short_run && i < shard + attempt.shards; ++i) {
    if (stage.shards[i] == ShardState::kPending) {
      actions.failures.push_back({job.id, stage.name, i, attempt.worker_name,
                                  "its worker fell silent", TroubleKind::kLost});
    }
  }
  judge(job, attempt.stage, shard, now, actions);
  settle(job, now, actions);
}

// The attempt's progress stands still. A long run is cut like one whose worker was lost, since any
// of its shards may be the cause; one that hangs alone has failed.
void Queue::take_away(std::uint64_t id, Time now, Actions& actions) {
  if (!attempts_.contains(id)) {
    return;
  }
  const Attempt attempt = end_attempt(id, Outcome::kHung, kHung, now, actions);
  actions.wake = true;
  JobState& job = *find_job(attempt.job);
  note_failure(job.stages[attempt.stage], attempt.worker, now);
  const bool is_run = attempt.shards > 1 && attempt.purpose != Purpose::kAudit;
  release(attempt, is_run ? losses_after(attempt.losses, attempt.shards) : attempt.losses, now);
  if (!is_run) {
    fail_shard(attempt, attempt.first_shard, kHung, TroubleKind::kHung, now, actions);
  }
}

// REQUIRES: the attempt has ended and has been released.
void Queue::fail_shard(const Attempt& attempt, std::uint64_t shard, const std::string& message,
                       TroubleKind kind, Time now, Actions& actions) {
  if (attempt.purpose == Purpose::kAudit) {
    audit_not_done(attempt, shard, now, actions);
    return;
  }
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  const auto blocked = blocked_.find(attempt.worker_name);
  const bool is_blocked = blocked != blocked_.end() && blocked->second.contains(stage.name);
  if (stage.shards[shard] == ShardState::kDone || is_blocked) {
    return;  // somebody else could do it, or would be asked
  }
  ++stage.failures;
  const bool is_pending = stage.shards[shard] == ShardState::kPending;
  if (is_pending) {
    withdraw(stage, shard);
  }
  ShardTrouble& trouble = stage.troubles[shard];
  ++trouble.failures[attempt.worker_name];
  trouble.messages[message].insert(attempt.worker_name);
  trouble.last_message = message;
  trouble.last_attempt = attempt.id;
  const std::uint32_t doublings = std::min(trouble.failure_count() - 1, kDoublings);
  trouble.retry_at = now + std::chrono::milliseconds(settings_.retry_ms) * (1 << doublings);
  if (is_pending) {
    put_back(stage, shard, 0);
  }
  actions.failures.push_back({job.id, stage.name, shard, attempt.worker_name, message, kind});
  judge(job, attempt.stage, shard, now, actions);
  settle(job, now, actions);
}

// The caller settles the job.
void Queue::judge(JobState& job, std::size_t index, std::uint64_t shard, Time now,
                  Actions& actions) {
  StageState& stage = job.stages[index];
  const auto trouble = stage.troubles.find(shard);
  if (job.has_ended() || trouble == stage.troubles.end() ||
      stage.shards[shard] != ShardState::kPending) {
    return;
  }
  std::optional<Verdict> verdict =
      judge_losses(trouble->second, losses_elsewhere(job, stage, shard), settings_);
  if (!verdict) {
    verdict = judge_failures(trouble->second, eligible(job, stage, now), settings_);
  }
  if (verdict) {
    quarantine(job, index, shard, *verdict, now, actions);
  }
}

void Queue::quarantine(JobState& job, std::size_t index, std::uint64_t shard,
                       const Verdict& verdict, Time now, Actions& actions) {
  StageState& stage = job.stages[index];
  withdraw(stage, shard);
  stage.shards[shard] = ShardState::kQuarantined;
  ++stage.quarantined;
  job.troubles.push_back({verdict.kind, stage.name, shard,
                          in_words(stage, shard) + " is quarantined: " + verdict.message,
                          verdict.workers, stage.troubles.at(shard).last_attempt, ""});
  ++job.revision;
  actions.wake = true;
  refresh(job, now);
}

// How often workers of those names that were lost with the shard alone were lost without it. A
// death that another shard is suspected of speaks neither way.
std::map<std::string, std::size_t> Queue::losses_elsewhere(const JobState& job,
                                                           const StageState& stage,
                                                           std::uint64_t shard) const {
  constexpr std::size_t kSuspicious = 3;
  const auto is_suspicious = [&](const Deaths::Held& held) {
    const JobState* const of = held.shards == 1 ? this->job(held.job) : nullptr;
    if (of == nullptr) {
      return false;
    }
    return std::any_of(of->stages.begin(), of->stages.end(), [&](const StageState& other) {
      const auto trouble = other.troubles.find(held.first_shard);
      return other.name == held.stage && trouble != other.troubles.end() &&
             trouble->second.lone_losses.size() >= kSuspicious;
    });
  };
  std::map<std::string, std::size_t> elsewhere;
  for (const LoneLoss& loss : stage.troubles.at(shard).lone_losses) {
    if (!elsewhere.contains(loss.worker)) {
      elsewhere[loss.worker] = deaths_.elsewhere(loss.worker, [&](const Deaths::Held& held) {
        return (held.job == job.id && held.stage == stage.name && held.contains(shard)) ||
               is_suspicious(held);
      });
    }
  }
  return elsewhere;
}

// A lost worker counts against a shard when others of its name gave results since, or it did
// shortly before.
bool Queue::survives(const LoneLoss& loss) const {
  const auto passed = passed_at_.find(loss.worker);
  return passed != passed_at_.end() &&
         passed->second >= loss.at - std::chrono::milliseconds(settings_.forget_worker_ms);
}

void Queue::confirm_losses(JobState& job, std::size_t index, Time now, Actions& actions) {
  StageState& stage = job.stages[index];
  std::vector<std::uint64_t> shards;
  for (auto it = stage.deadly.rbegin();
       it != stage.deadly.rend() && it->first >= settings_.lonely_loss_limit; ++it) {
    shards.push_back(it->second);
  }
  for (const std::uint64_t shard : shards) {
    for (LoneLoss& loss : stage.troubles.at(shard).lone_losses) {
      loss.is_confirmed = loss.is_confirmed || survives(loss);
    }
    judge(job, index, shard, now, actions);
  }
}

// The worker was cut off, not killed: the shard is not to blame.
void Queue::absolve(StageState& stage, std::uint64_t shard, const std::string& worker_name) {
  const auto entry = stage.troubles.find(shard);
  if (entry == stage.troubles.end() || stage.shards[shard] != ShardState::kPending) {
    return;
  }
  withdraw(stage, shard);
  std::vector<LoneLoss>& losses = entry->second.lone_losses;
  const auto last = std::find_if(losses.rbegin(), losses.rend(),
                                 [&](const LoneLoss& loss) { return loss.worker == worker_name; });
  if (last != losses.rend()) {
    losses.erase(std::next(last).base());
  }
  if (entry->second.is_empty()) {
    stage.troubles.erase(entry);
  }
  put_back(stage, shard, 0);
}

// A resource is short on that worker: the stage stays away from it for a while.
void Queue::short_of_resource(const Attempt& attempt, const std::string& worker, Time now) {
  Backoff& backoff = find_job(attempt.job)->stages[attempt.stage].backoffs[worker];
  backoff.step_ms = backoff.step_ms == 0 ? settings_.short_ms
                                         : std::min(backoff.step_ms * 2, settings_.short_limit_ms);
  backoff.until = now + std::chrono::milliseconds(backoff.step_ms);
  backoff.is_short = true;
}

// A worker that fails again and again waits between its attempts, so that it does not eat the job
// before others have shown that it is at fault.
void Queue::note_failure(StageState& stage, const std::string& worker, Time now) {
  Backoff& backoff = stage.backoffs[worker];
  if (++backoff.failures < 2) {
    return;
  }
  const std::uint64_t wait_ms = std::uint64_t{settings_.retry_ms}
                                << std::min(backoff.failures - 2, kDoublings);
  backoff.until =
      now + std::chrono::milliseconds(std::min<std::uint64_t>(wait_ms, settings_.short_limit_ms));
  backoff.is_short = false;
}

// What failed on this worker was done by another one.
void Queue::passed_elsewhere(const std::string& worker_name, StageName stage, Time now,
                             Actions& actions) {
  Conduct& conduct = conduct_[{worker_name, stage}];
  ++conduct.passed_elsewhere;
  if (conduct.is_bad(settings_)) {
    block(worker_name, stage, false, now, actions);
  }
}

void Queue::block(const std::string& worker_name, StageName stage, bool is_liar, Time now,
                  Actions& actions) {
  std::map<StageName, bool>& kinds = blocked_[worker_name];
  const auto known = kinds.find(stage);
  if (known != kinds.end() && (known->second || !is_liar)) {
    return;
  }
  kinds[stage] = is_liar;
  conduct_.erase({worker_name, stage});
  actions.blocks.push_back({worker_name, stage, true, is_liar});
  actions.wake = true;
  forgive(worker_name, stage, now, actions);
  if (!is_liar) {
    return;
  }
  std::vector<std::uint64_t> running;
  for (const auto& [id, attempt] : attempts_) {
    const StageName name = find_job(attempt.job)->stages[attempt.stage].name;
    if (attempt.worker_name == worker_name && name == stage) {
      running.push_back(id);
    }
  }
  for (const std::uint64_t id : running) {
    const Attempt attempt =
        end_attempt(id, Outcome::kStopped, "its worker gave wrong results", now, actions);
    release(attempt, attempt.losses, now);
  }
  doubt(worker_name, stage, now);
}

// The worker was at fault: its failures count no longer, and verdicts that rest on them fall.
void Queue::forgive(const std::string& worker_name, StageName name, Time now, Actions& actions) {
  for (auto& [order, job] : jobs_) {
    for (std::uint32_t s = 0; s < job.stages.size() && !job.has_ended(); ++s) {
      StageState& stage = job.stages[s];
      if (stage.name != name) {
        continue;
      }
      std::vector<std::uint64_t> shards;
      for (const auto& [shard, trouble] : stage.troubles) {
        if (trouble.failures.contains(worker_name)) {
          shards.push_back(shard);
        }
      }
      for (const std::uint64_t shard : shards) {
        forgive_shard({shard, static_cast<std::uint32_t>(order), s}, worker_name, now);
      }
      if (stage.failures > 0 || !shards.empty()) {
        actions.failures_dropped.push_back({job.id, name, worker_name});
        ++job.revision;
        refresh(job, now);
      }
    }
  }
}

void Queue::forgive_shard(const ShardRef& ref, const std::string& worker_name, Time now) {
  JobState& job = jobs_.at(ref.job_order);
  StageState& stage = job.stages[ref.stage];
  const ShardState state = stage.shards[ref.shard];
  if (state == ShardState::kPending) {
    withdraw(stage, ref.shard);
  }
  ShardTrouble& trouble = stage.troubles.at(ref.shard);
  trouble.forgive(worker_name);
  const bool still_stands =
      judge_losses(trouble, losses_elsewhere(job, stage, ref.shard), settings_) ||
      judge_failures(trouble, eligible(job, stage, now), settings_);
  trouble.retry_at = std::min(trouble.retry_at, now);
  if (trouble.is_empty()) {
    stage.troubles.erase(ref.shard);
  }
  if (state == ShardState::kPending) {
    put_back(stage, ref.shard, 0);
  } else if (state == ShardState::kQuarantined && !still_stands) {
    --stage.quarantined;
    std::erase_if(job.troubles, [&](const Trouble& entry) {
      return entry.stage == stage.name && entry.shard == ref.shard &&
             entry.kind != Trouble::Kind::kMismatch;
    });
    make_pending(ref, 0);
  }
}

}  // namespace weft::coordinator
