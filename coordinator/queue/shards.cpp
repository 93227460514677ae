#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// What becomes of single shards: pending, running, done, given back.

namespace weft::coordinator {

namespace {

constexpr auto kRateWindow = std::chrono::seconds(60);
constexpr auto kRateStep = std::chrono::seconds(1);
constexpr std::size_t kRateSamples = 256;

}  // namespace

const std::string& Queue::author_name(std::uint32_t author) const { return names_.at(author); }

std::uint32_t Queue::author_of(const std::string& worker_name) {
  if (worker_name.empty()) {
    return 0;
  }
  const auto [entry, is_new] =
      author_of_name_.emplace(worker_name, static_cast<std::uint32_t>(names_.size()));
  if (is_new) {
    names_.push_back(worker_name);
  }
  return entry->second;
}

void Queue::add_ref(const core::Digest& work, const ShardRef& ref) {
  twins_ += unfinished_.contains(work) ? 1 : 0;
  unfinished_.emplace(work, ref);
}

void Queue::forget_ref(const core::Digest& work, const ShardRef& ref) {
  const auto [begin, end] = unfinished_.equal_range(work);
  const auto found =
      std::find_if(begin, end, [&](const auto& entry) { return entry.second == ref; });
  if (found != end) {
    unfinished_.erase(found);
    twins_ -= unfinished_.contains(work) ? 1 : 0;
  }
}

// Ends a shard in every job that has it.
void Queue::finish_shard(const core::Digest& work, const core::Digest& result,
                         const std::string& worker, Time now, Actions& actions) {
  const auto [begin, end] = unfinished_.equal_range(work);
  CHECK(begin != end);
  std::vector<ShardRef> refs;
  for (auto it = begin; it != end; ++it) {
    refs.push_back(it->second);
  }
  unfinished_.erase(begin, end);
  twins_ -= refs.size() - 1;
  std::set<std::string> failed_on;
  StageName name = StageName::kGeometry;
  for (const ShardRef& ref : refs) {
    const StageState& stage = jobs_.at(ref.job_order).stages[ref.stage];
    name = stage.name;
    const auto trouble = stage.troubles.find(ref.shard);
    if (trouble != stage.troubles.end()) {
      for (const auto& [failed, times] : trouble->second.failures) {
        failed_on.insert(failed);
      }
    }
    mark_done(ref, result, author_of(worker), now, actions);
  }
  failed_on.erase(worker);
  for (const std::string& failed : failed_on) {
    passed_elsewhere(failed, name, now, actions);
  }
  for (const ShardRef& ref : refs) {
    settle(jobs_.at(ref.job_order), now, actions);
  }
}

void Queue::mark_done(const ShardRef& ref, const core::Digest& result, std::uint32_t author,
                      Time now, Actions& actions) {
  JobState& job = jobs_.at(ref.job_order);
  StageState& stage = job.stages[ref.stage];
  switch (stage.shards[ref.shard]) {
    case ShardState::kPending:
      withdraw(stage, ref.shard);
      break;
    case ShardState::kRunning:
      --stage.running;
      stage.doubled.erase(ref.shard);
      break;
    case ShardState::kElsewhere:
      --stage.elsewhere;
      break;
    case ShardState::kQuarantined:
      --stage.quarantined;
      std::erase_if(job.troubles, [&](const Trouble& trouble) {
        return trouble.stage == stage.name && trouble.shard == ref.shard &&
               trouble.kind != Trouble::Kind::kMismatch;
      });
      break;
    case ShardState::kDone:
      CHECK(false);
  }
  stage.shards[ref.shard] = ShardState::kDone;
  stage.results[ref.shard] = result;
  stage.authors[ref.shard] = author;
  ++stage.done;
  stage.troubles.erase(ref.shard);
  ++job.revision;
  if (is_chosen(stage.digests[ref.shard], job.demands.audit)) {
    await_audit(stage, ref.shard, now);
    actions.wake = actions.wake || stage.pending() == 0;
  }
  if (stage.is_done()) {
    stage.ended_at = now;
    actions.wake = true;
    ask_for_plan(job, actions);
  }
  refresh(job, now);
}

// REQUIRES: the shard is pending. The caller has taken it from the fresh ones.
void Queue::mark_running(const ShardRef& ref) {
  StageState& stage = jobs_.at(ref.job_order).stages[ref.stage];
  withdraw(stage, ref.shard);
  stage.shards[ref.shard] = ShardState::kRunning;
  ++stage.running;
  if (twins_ == 0) {
    return;
  }
  const auto [begin, end] = unfinished_.equal_range(stage.digests[ref.shard]);
  for (auto it = begin; it != end; ++it) {
    const ShardRef& twin = it->second;
    JobState& its_job = jobs_.at(twin.job_order);
    StageState& its_stage = its_job.stages[twin.stage];
    if (its_stage.shards[twin.shard] == ShardState::kPending) {
      withdraw(its_stage, twin.shard);
      its_stage.shards[twin.shard] = ShardState::kElsewhere;
      ++its_stage.elsewhere;
      ++its_job.revision;
      refresh(its_job, last_event_at_);
    }
  }
}

// Queues a shard, unless equal work is running. REQUIRES: it is in none of the pending sets.
void Queue::make_pending(const ShardRef& ref, std::size_t losses) {
  StageState& stage = jobs_.at(ref.job_order).stages[ref.stage];
  bool runs_elsewhere = false;
  if (twins_ > 0) {
    const auto [begin, end] = unfinished_.equal_range(stage.digests[ref.shard]);
    runs_elsewhere = std::any_of(begin, end, [&](const auto& entry) {
      const ShardRef& twin = entry.second;
      return jobs_.at(twin.job_order).stages[twin.stage].shards[twin.shard] == ShardState::kRunning;
    });
  }
  stage.shards[ref.shard] = runs_elsewhere ? ShardState::kElsewhere : ShardState::kPending;
  if (runs_elsewhere) {
    ++stage.elsewhere;
  } else {
    put_back(stage, ref.shard, losses);
  }
}

void Queue::put_back(StageState& stage, std::uint64_t shard, std::size_t losses) {
  const auto trouble = stage.troubles.find(shard);
  if (trouble != stage.troubles.end() && !trouble->second.lone_losses.empty()) {
    stage.deadly.emplace(trouble->second.lone_losses.size(), shard);
  } else if (trouble != stage.troubles.end()) {
    stage.retries.emplace(trouble->second.retry_at, shard);
  } else if (losses > 0) {
    stage.suspects[std::min(losses, stage.suspects.size()) - 1].add(shard);
  } else {
    stage.fresh.add(shard);
  }
}

// Takes a pending shard out of where put_back put it.
void Queue::withdraw(StageState& stage, std::uint64_t shard) {
  const auto trouble = stage.troubles.find(shard);
  if (trouble != stage.troubles.end()) {
    stage.deadly.erase({trouble->second.lone_losses.size(), shard});
    stage.retries.erase({trouble->second.retry_at, shard});
    return;
  }
  stage.fresh.remove(shard);
  for (ShardRanges& suspects : stage.suspects) {
    if (!suspects.empty()) {
      suspects.remove(shard);
    }
  }
}

// Puts what an attempt leaves unfinished back, but for what another attempt runs too. REQUIRES: the
// attempt has ended.
void Queue::release(const Attempt& attempt, std::size_t losses, Time now) {
  JobState& job = *find_job(attempt.job);
  StageState& stage = job.stages[attempt.stage];
  ++job.revision;
  if (attempt.purpose == Purpose::kAudit) {
    put_back_audits(attempt, now);
    refresh(job, now);
    return;
  }
  const auto order = static_cast<std::uint32_t>(order_of_job_.at(job.id));
  const auto index = static_cast<std::uint32_t>(attempt.stage);
  for (std::uint64_t i = 0; i < attempt.shards; ++i) {
    const std::uint64_t shard = attempt.first_shard + i;
    if (stage.shards[shard] != ShardState::kRunning || attempt.skipped.contains(shard)) {
      continue;
    }
    const auto doubled = stage.doubled.find(shard);
    if (doubled != stage.doubled.end()) {
      if (--doubled->second == 0) {
        stage.doubled.erase(doubled);
      }
      continue;
    }
    --stage.running;
    const ShardRef ref{shard, order, index};
    stage.shards[shard] = ShardState::kPending;
    make_pending(ref, losses);
    if (twins_ > 0) {
      free_twins(ref, now);
    }
  }
  refresh(job, now);
}

// The run that others waited for is over without a result.
void Queue::free_twins(const ShardRef& ref, Time now) {
  const core::Digest work = jobs_.at(ref.job_order).stages[ref.stage].digests[ref.shard];
  const auto [begin, end] = unfinished_.equal_range(work);
  for (auto it = begin; it != end; ++it) {
    JobState& job = jobs_.at(it->second.job_order);
    StageState& stage = job.stages[it->second.stage];
    if (stage.shards[it->second.shard] == ShardState::kElsewhere) {
      --stage.elsewhere;
      stage.shards[it->second.shard] = ShardState::kPending;
      make_pending(it->second, 0);
      ++job.revision;
      refresh(job, now);
    }
  }
}

void Queue::sample_rate(std::uint64_t order, Time now) {
  JobState& job = jobs_.at(order);
  for (StageState& stage : job.stages) {
    const bool is_recent = stage.rate.size() > 1 && now - stage.rate.back().at < kRateStep;
    if (stage.is_done() || is_recent) {
      continue;
    }
    double shards = static_cast<double>(stage.done);
    for (const std::uint64_t id : stage.attempts) {
      const Attempt& attempt = attempts_.at(id);
      if (attempt.purpose == Purpose::kFirst) {
        shards += static_cast<double>(std::min(attempt.shards_done, attempt.shards));
      }
    }
    shards = std::min(shards, static_cast<double>(stage.shards.size()));
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
