#include <algorithm>
#include <set>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Results that a second worker is to confirm: the share of a job's shards that it asked for, and
// all that a liar gave. A job is committed when none is outstanding. Those that nobody could
// confirm for rebind_ms, because there is only one name of workers, are given up and counted.

namespace weft::coordinator {

// Chosen by the work alone, so that every start of the coordinator chooses the same.
bool Queue::is_chosen(const core::Digest& work, double share) {
  std::uint64_t number = 0;
  for (std::size_t i = 8; i < 16; ++i) {
    number = number << 8 | work.bytes[i];
  }
  constexpr double kAll = 18446744073709551616.0;  // 2^64
  return static_cast<double>(number) < share * kAll || share >= 1;
}

bool StageState::awaits_audit(std::uint64_t shard) const {
  const auto waiting = audits.find(authors[shard]);
  return waiting != audits.end() && waiting->second.contains(shard);
}

bool StageState::withdraw_audit(std::uint64_t shard) {
  if (!awaits_audit(shard)) {
    return false;
  }
  const auto waiting = audits.find(authors[shard]);
  waiting->second.remove(shard);
  if (waiting->second.empty()) {
    audits.erase(waiting);
  }
  return true;
}

void Queue::await_audit(StageState& stage, std::uint64_t shard, Time now) {
  if (stage.audits.empty()) {
    stage.audits_possible_at = now;
  }
  stage.audits[stage.authors[shard]].add(shard);
}

// Marks a shard as being checked by an attempt, if it waits for that.
bool Queue::take_audit(StageState& stage, std::uint64_t shard, std::uint64_t attempt) {
  if (stage.shards[shard] != ShardState::kDone) {
    return false;
  }
  if (stage.disputed.contains(shard)) {
    Dispute& dispute = disputes_.at(stage.digests[shard]);
    const bool is_free = dispute.attempt == 0;
    dispute.attempt = is_free ? attempt : dispute.attempt;
    return is_free;
  }
  if (!stage.withdraw_audit(shard)) {
    return false;
  }
  stage.auditing.add(shard);
  return true;
}

// The attempt is over; what it did not check waits again.
void Queue::put_back_audits(const Attempt& attempt, Time now) {
  StageState& stage = find_job(attempt.job)->stages[attempt.stage];
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    const std::uint64_t shard = attempt.first_shard + i;
    if (stage.auditing.contains(shard)) {
      stage.auditing.remove(shard);
      await_audit(stage, shard, now);
    }
  }
}

// An audit failed, hung or was lost with its worker. The shard itself is done.
void Queue::audit_not_done(const Attempt& attempt, std::uint64_t shard, Time now,
                           Actions& actions) {
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  const std::uint32_t failures = ++stage.audit_failures[shard];
  if (stage.disputed.contains(shard)) {
    if (failures >= settings_.failure_limit) {
      give_up(core::Digest(stage.digests[shard]), "further workers could not compute it", now,
              actions);
    }
    return;
  }
  if (failures >= settings_.failure_limit && stage.withdraw_audit(shard)) {
    ++job.audits_given_up;
    refresh(job, now);
    settle(job, now, actions);
  }
}

// A further result of a shard that is done. May make the job begin again.
void Queue::compare(JobState& job, std::size_t index, std::uint64_t shard,
                    const Dispute::Opinion& opinion, Time now, Actions& actions) {
  StageState& stage = job.stages[index];
  const core::Digest work = stage.digests[shard];
  if (disputes_.contains(work)) {
    hear(work, opinion, now, actions);
  } else if (stage.results[shard] != opinion.result) {
    dispute(job, index, shard, opinion, now, actions);
  } else if (opinion.worker != author_name(stage.authors[shard])) {
    confirm(job, stage, shard, opinion.worker, now, actions);
  }
}

void Queue::confirm(JobState& job, StageState& stage, std::uint64_t shard,
                    const std::string& worker, Time now, Actions& actions) {
  if (!stage.withdraw_audit(shard) && !stage.auditing.contains(shard)) {
    return;
  }
  stage.auditing.remove(shard);
  ++job.audited_shards;
  ++job.revision;
  actions.audits.push_back({stage.digests[shard], worker});
  refresh(job, now);
  settle(job, now, actions);
}

// The jobs whose audits wait though nobody can do them give these up; so do disputes.
void Queue::look_after_audits(Time now, Actions& actions) {
  for (auto& [order, job] : jobs_) {
    if (job.has_ended()) {
      continue;
    }
    for (std::size_t s = 0; s < job.stages.size(); ++s) {
      if (!job.stages[s].deadly.empty()) {
        confirm_losses(job, s, now, actions);
      }
      look_after_audits(job, job.stages[s], now);
    }
    refresh(job, now);
    settle(job, now, actions);
  }
  std::vector<core::Digest> hopeless;
  for (const auto& [work, dispute] : disputes_) {
    const bool is_planning =
        std::any_of(dispute.jobs.begin(), dispute.jobs.end(),
                    [&](std::uint64_t order) { return jobs_.at(order).planning; });
    if (dispute.attempt == 0 && !is_planning &&
        now - dispute.possible_at > std::chrono::milliseconds(settings_.rebind_ms)) {
      hopeless.push_back(work);
    }
  }
  for (const core::Digest& work : hopeless) {
    give_up(work, "there was no further worker to ask", now, actions);
  }
}

void Queue::look_after_audits(JobState& job, StageState& stage, Time now) {
  if (stage.audits.empty() && stage.disputed.empty()) {
    return;
  }
  if (job.is_paused) {
    stage.audits_possible_at = now;  // not for want of workers
    for (const std::uint64_t shard : stage.disputed) {
      disputes_.at(stage.digests[shard]).possible_at = now;
    }
    return;
  }
  // A worker that must end soon may never take any.
  std::set<std::string> names;
  for (const auto& [id, worker] : workers_) {
    const Obstacle obstacle = hindrance(worker, job, stage, now).obstacle;
    const bool is_for_a_while = obstacle >= Obstacle::kShort && obstacle != Obstacle::kWallTime;
    if (obstacle == Obstacle::kNone || is_for_a_while) {
      names.insert(worker.name);
    }
  }
  for (const std::uint64_t shard : stage.disputed) {
    Dispute& dispute = disputes_.at(stage.digests[shard]);
    const bool is_possible = std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return !dispute.has_asked(name);
    });
    dispute.possible_at = is_possible || dispute.attempt != 0 ? now : dispute.possible_at;
  }
  const auto cannot = [&](const auto& waiting) {
    return names.empty() || (names.size() == 1 && *names.begin() == author_name(waiting.first));
  };
  const bool all_possible = std::none_of(stage.audits.begin(), stage.audits.end(), cannot);
  if (all_possible) {
    stage.audits_possible_at = now;
  } else if (now - stage.audits_possible_at > std::chrono::milliseconds(settings_.rebind_ms)) {
    for (auto it = stage.audits.begin(); it != stage.audits.end();) {
      const bool is_hopeless = cannot(*it);
      job.audits_given_up += is_hopeless ? it->second.size() : 0;
      it = is_hopeless ? stage.audits.erase(it) : std::next(it);
    }
    ++job.revision;
  }
}

// All that a liar gave of this kind is to be confirmed by others.
void Queue::doubt(const std::string& worker_name, StageName name, Time now) {
  const std::uint32_t liar = author_of(worker_name);
  for (auto& [order, job] : jobs_) {
    if (job.has_ended() || job.phase == JobPhase::kCommitting) {
      continue;
    }
    for (StageState& stage : job.stages) {
      for (std::uint64_t i = 0; stage.name == name && i < stage.shards.size(); ++i) {
        if (stage.shards[i] == ShardState::kDone && stage.authors[i] == liar &&
            !stage.auditing.contains(i) && !stage.disputed.contains(i)) {
          await_audit(stage, i, now);
        }
      }
    }
    refresh(job, now);
  }
}

}  // namespace weft::coordinator
