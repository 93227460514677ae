#include <algorithm>

#include "coordinator/queue.h"
#include "core/check.h"

// What becomes of single shards: done, failed, given back, lost.

namespace weft::coordinator {

namespace {

constexpr auto kRateWindow = std::chrono::seconds(60);
constexpr std::size_t kRateSamples = 256;

std::string in_words(const StageState& stage, std::uint64_t shard) {
  return std::string(to_string(stage.name)) + " shard " + std::to_string(shard) + " of " +
         std::to_string(stage.shards.size());
}

}  // namespace

void Queue::forget_ref(const core::Digest& work, const ShardRef& ref) {
  const auto found = unfinished_.find(work);
  if (found == unfinished_.end()) {
    return;
  }
  std::erase(found->second, ref);
  if (found->second.empty()) {
    unfinished_.erase(found);
  }
}

// Ends a shard in every job that has it.
void Queue::finish_shard(const core::Digest& work, const core::Digest& result, Time now,
                         Actions& actions) {
  const auto found = unfinished_.find(work);
  CHECK(found != unfinished_.end());
  const std::vector<ShardRef> refs = std::move(found->second);
  unfinished_.erase(found);
  for (const ShardRef& ref : refs) {
    JobState& job = jobs_.at(ref.job_order);
    StageState& stage = job.stages[ref.stage];
    if (stage.shards[ref.shard] == ShardState::kRunning) {
      --stage.running;
    }
    stage.shards[ref.shard] = ShardState::kDone;
    stage.results[ref.shard] = result;
    ++stage.done;
    stage.troubles.erase(ref.shard);
    ++job.revision;
    if (stage.is_done()) {
      stage.ended_at = now;
      actions.wake = true;
      ask_for_plan(job, actions);
    }
  }
}

// Puts what an attempt leaves unfinished back among the pending shards. The caller erases it.
void Queue::release(const Attempt& attempt) {
  JobState* const job = find_job(attempt.job);
  CHECK(job != nullptr);
  StageState& stage = job->stages[attempt.stage];
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    const std::uint64_t shard = attempt.first_shard + i;
    if (stage.shards[shard] == ShardState::kRunning) {
      stage.shards[shard] = ShardState::kPending;
      --stage.running;
      stage.first_pending = std::min(stage.first_pending, shard);
    }
  }
  ++job->revision;
}

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
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    const std::uint64_t shard = attempt.first_shard + i;
    if (stage.shards[shard] != ShardState::kRunning) {
      continue;
    }
    ShardTrouble& trouble = stage.troubles[shard];
    ++trouble.losses;
    trouble.lonely_losses += attempt.shards == 1 ? 1 : 0;
    if (trouble.lonely_losses >= settings_.lonely_loss_limit) {
      job.error = in_words(stage, shard) +
                  " is quarantined: " + std::to_string(trouble.lonely_losses) +
                  " workers were lost while they ran it alone (last: " + attempt.worker +
                  "); look for crashes or kills for lack of memory on those workers";
    }
  }
  release(attempt);
  if (!job.error.empty()) {
    end_job(job, JobPhase::kFailed, now, actions);
  }
}

void Queue::expire(Time now, Actions& actions) {
  while (!leases_.empty() && leases_.begin()->first < now) {
    lose(leases_.begin()->second, now, actions);
  }
}

// REQUIRES: the attempt owns its shards and has been released.
void Queue::fail_shard(const Attempt& attempt, const Failure& failure, Time now, Actions& actions) {
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  const bool is_of_run =
      failure.shard >= attempt.first_shard && failure.shard - attempt.first_shard < attempt.shards;
  const std::uint64_t shard = is_of_run ? failure.shard : attempt.first_shard;
  if (stage.shards[shard] == ShardState::kDone) {
    return;  // somebody else could do it
  }
  ++stage.failures;
  ShardTrouble& trouble = stage.troubles[shard];
  ++trouble.failures;
  trouble.workers.insert(attempt.worker);
  std::set<std::string>& same = trouble.messages[failure.message];
  same.insert(attempt.worker);
  trouble.retry_at = now + std::chrono::milliseconds(settings_.retry_ms) *
                               (1 << std::min(trouble.failures - 1, 10U));
  actions.failures.push_back(
      {job.id, stage.name, shard, attempt.worker, failure.message, TroubleKind::kFailed});
  const bool is_quarantined =
      trouble.failures >= settings_.failure_limit || same.size() >= settings_.same_error_limit;
  if (is_quarantined) {
    job.error = in_words(stage, shard) + " is quarantined after " +
                std::to_string(trouble.failures) + " failures on " +
                std::to_string(trouble.workers.size()) + " workers: " + failure.message;
    end_job(job, JobPhase::kFailed, now, actions);
  }
}

// A resource is short on that worker: the stage stays away from it for a while.
void Queue::back_off(const Attempt& attempt, const std::string& worker, Time now) {
  Backoff& backoff = find_job(attempt.job)->stages[attempt.stage].backoffs[worker];
  backoff.step_ms = backoff.step_ms == 0 ? settings_.short_ms
                                         : std::min(backoff.step_ms * 2, settings_.short_limit_ms);
  backoff.until = now + std::chrono::milliseconds(backoff.step_ms);
}

void Queue::sample_rate(std::uint64_t order, Time now) {
  JobState& job = jobs_.at(order);
  for (StageState& stage : job.stages) {
    if (stage.is_done()) {
      continue;
    }
    double shards = static_cast<double>(stage.done);
    for (const std::uint64_t id : stage.attempts) {
      const Attempt& attempt = attempts_.at(id);
      shards += static_cast<double>(std::min(attempt.shards_done, attempt.shards));
    }
    if (!stage.rate.empty() && stage.rate.back().at == now) {
      stage.rate.back().shards = shards;
    } else {
      stage.rate.push_back({now, shards});
    }
    while (stage.rate.size() > kRateSamples ||
           (stage.rate.size() > 2 && stage.rate.front().at + kRateWindow < now)) {
      stage.rate.pop_front();
    }
  }
}

double Queue::shards_per_second(const StageState& stage) {
  if (stage.rate.size() < 2) {
    return 0;
  }
  const double seconds =
      std::chrono::duration<double>(stage.rate.back().at - stage.rate.front().at).count();
  const double shards = stage.rate.back().shards - stage.rate.front().shards;
  return seconds > 0 && shards > 0 ? shards / seconds : 0;
}

}  // namespace weft::coordinator
