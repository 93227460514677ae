#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// A stage as it comes from its plan, with what is known of it from before: results, failures, and
// attempts that may still run.

namespace weft::coordinator {

namespace {

// The job's disputed shards of that work wait for another worker's word instead.
void end_dispute(JobState& job, const core::Digest& work, Time now) {
  for (StageState& stage : job.stages) {
    const std::set<std::uint64_t> disputed = stage.disputed;
    for (const std::uint64_t shard : disputed) {
      if (stage.digests[shard] == work) {
        stage.disputed.erase(shard);
        stage.audits[stage.authors[shard]].add(shard);
        stage.audits_possible_at = now;
      }
    }
  }
}

}  // namespace

std::uint64_t StageState::unconfirmed() const {
  std::uint64_t count = auditing.size() + disputed.size();
  for (const auto& [author, shards_due] : audits) {
    count += shards_due.size();
  }
  return count;
}

std::uint64_t JobState::quarantined() const {
  std::uint64_t count = 0;
  for (const StageState& stage : stages) {
    count += stage.quarantined;
  }
  return count;
}

std::uint64_t JobState::unconfirmed() const {
  std::uint64_t count = 0;
  for (const StageState& stage : stages) {
    count += stage.unconfirmed();
  }
  return count;
}

void Queue::add_stage(std::uint64_t order, JobState& job, const PlannedStage& planned, Time now,
                      Actions& actions) {
  const std::size_t index = job.stages.size();
  StageState& stage = job.stages.emplace_back();
  const std::size_t count = planned.digests.size();
  stage.name = planned.name;
  stage.scene = planned.scene;
  stage.memory_bytes = planned.memory_bytes;
  stage.digests = planned.digests;
  stage.shards.assign(count, ShardState::kPending);
  stage.results.assign(count, core::Digest{});
  stage.authors.assign(count, 0);
  stage.started_at = now;
  add_known(order, job, index, planned, now, actions);
  add_failures(job, index, planned, now);
  std::uint64_t first = 0;  // of the shards in a row that are pending and were in no trouble
  for (std::uint64_t i = 0; i < count; ++i) {
    if (stage.shards[i] == ShardState::kDone) {
      stage.fresh.add(first, i - first);
      first = i + 1;
      continue;
    }
    const ShardRef ref{i, static_cast<std::uint32_t>(order), static_cast<std::uint32_t>(index)};
    add_ref(stage.digests[i], ref);
    const auto gone = disputes_.find(stage.digests[i]);
    if (gone != disputes_.end()) {  // the result that it was about is
      for (const std::uint64_t other : gone->second.jobs) {
        end_dispute(jobs_.at(other), stage.digests[i], now);
      }
      disputes_.erase(gone);
    }
    if (twins_ > 0 || stage.troubles.contains(i)) {
      stage.fresh.add(first, i - first);
      first = i + 1;
      make_pending(ref, 0);
    }
  }
  stage.fresh.add(first, count - first);
  for (const PriorFailure& prior : planned.failures) {
    const bool is_suspect = prior.kind == TroubleKind::kLost && stage.fresh.contains(prior.shard);
    if (is_suspect) {
      stage.fresh.remove(prior.shard);
      put_back(stage, prior.shard, kSuspectRunShards.size());
    }
  }
  for (const PriorLoss& loss : planned.losses) {
    deaths_.add(loss.worker_name, loss.worker, loss.at,
                {job.id, stage.name, loss.first_shard, loss.shards});
  }
  for (const PriorAttempt& prior : planned.attempts) {
    restore(job, index, prior, now, actions);
  }
  std::vector<std::uint64_t> troubled;
  for (const auto& [shard, trouble] : stage.troubles) {
    troubled.push_back(shard);
  }
  for (const std::uint64_t shard : troubled) {
    judge(job, index, shard, now, actions);
  }
  if (stage.is_done()) {
    stage.ended_at = now;
  }
  if (stage.done > 0 || stage.running > 0) {
    job.phase = JobPhase::kRunning;
  }
}

void Queue::add_known(std::uint64_t order, JobState& job, std::size_t index,
                      const PlannedStage& planned, Time now, Actions& actions) {
  StageState& stage = job.stages[index];
  for (const KnownResult& known : planned.known) {
    CHECK_LT(known.shard, stage.shards.size());
    if (stage.shards[known.shard] != ShardState::kPending) {
      continue;
    }
    stage.shards[known.shard] = ShardState::kDone;
    stage.results[known.shard] = known.result;
    stage.authors[known.shard] = author_of(known.worker);
    ++stage.done;
    ++stage.cached;
    const core::Digest& work = stage.digests[known.shard];
    const auto disputed = disputes_.find(work);
    if (disputed != disputes_.end()) {
      disputed->second.jobs.insert(order);
      join_dispute(job, stage, known.shard, disputed->second, actions);
    } else if (!dispute_again(job, index, known.shard, now, actions) && !known.is_audited &&
               (is_chosen(work, job.demands.audit) || is_liar(known.worker, stage.name))) {
      await_audit(stage, known.shard, now);
    }
  }
  std::erase_if(job.open_mismatches,
                [&](const MismatchRecord& open) { return open.stage == stage.name; });
}

void Queue::add_failures(JobState& job, std::size_t index, const PlannedStage& planned, Time now) {
  StageState& stage = job.stages[index];
  for (const PriorFailure& prior : planned.failures) {
    const bool is_open =
        prior.shard < stage.shards.size() && stage.shards[prior.shard] == ShardState::kPending;
    if (!is_open || prior.kind == TroubleKind::kLost) {
      continue;
    }
    ShardTrouble& trouble = stage.troubles[prior.shard];
    trouble.retry_at = now;
    if (prior.kind == TroubleKind::kLoneLoss) {
      trouble.lone_losses.push_back({prior.worker, now, true});
    } else {
      ++trouble.failures[prior.worker];
      trouble.messages[prior.message].insert(prior.worker);
      trouble.last_message = prior.message;
    }
  }
}

// What ran before a restart goes on: its worker owns it for one lease, and longer if it comes back.
void Queue::restore(JobState& job, std::size_t index, const PriorAttempt& prior, Time now,
                    Actions& actions) {
  StageState& stage = job.stages[index];
  const std::uint64_t count = stage.shards.size();
  const bool is_prior = prior.id >> 32 < next_attempt_ >> 32 && !attempts_.contains(prior.id);
  const bool fits = prior.first_shard < count && prior.shards <= count - prior.first_shard;
  if (!is_prior || !fits) {
    return;
  }
  Attempt attempt;
  attempt.id = prior.id;
  attempt.job = job.id;
  attempt.stage = index;
  attempt.first_shard = prior.first_shard;
  attempt.shards = prior.shards;
  attempt.worker = prior.worker;
  attempt.worker_name = prior.worker_name;
  attempt.purpose = prior.purpose;
  const std::uint64_t owned = job.is_paused ? 0 : take_shards(attempt);
  if (owned == 0) {
    actions.attempts_ended.push_back(
        {job.id, prior.id, job.is_paused ? Outcome::kStopped : Outcome::kSuperseded, 0,
         job.is_paused ? "its job was paused" : "others brought its results",
         now.time_since_epoch().count()});
    return;
  }
  attempt.token = make_token(stage, prior.first_shard, prior.shards);
  begin_attempt(std::move(attempt), now);
}

}  // namespace weft::coordinator
