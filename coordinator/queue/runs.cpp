#include <algorithm>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Which shards of a stage a worker is given at once, and how many.

namespace weft::coordinator {

namespace {

std::uint64_t ceil_div(std::uint64_t count, std::uint64_t divisor) {
  return (count + divisor - 1) / divisor;
}

}  // namespace

// Shards that failed come first and alone, so that they are decided soon; then those that were in
// no trouble. Shards that were with workers when those were lost come last, those with the fewest
// losses first: they may be the cause.
std::optional<Queue::Run> Queue::pending_run(std::uint64_t order, std::size_t index,
                                             const WorkerState& worker, std::uint64_t limit,
                                             Time now) const {
  const JobState& job = jobs_.at(order);
  const StageState& stage = job.stages[index];
  for (const auto& [retry_at, shard] : stage.retries) {
    if (retry_at > now) {
      break;
    }
    if (!is_left_to_others(job, stage, stage.troubles.at(shard), worker, now)) {
      return Run{order, index, shard, 1};
    }
  }
  if (!stage.fresh.empty()) {
    const ShardRanges::Range range = stage.fresh.front();
    return Run{order, index, range.first, std::min(limit, range.count)};
  }
  for (std::size_t losses = 1; losses <= stage.suspects.size(); ++losses) {
    const ShardRanges& suspects = stage.suspects[losses - 1];
    if (!suspects.empty()) {
      const ShardRanges::Range range = suspects.front();
      const std::uint64_t longest = std::min(limit, kSuspectRunShards[losses - 1]);
      return Run{order,           index, range.first, std::min(longest, range.count),
                 Purpose::kFirst, losses};
    }
  }
  for (const auto& [losses, shard] : stage.deadly) {
    const ShardTrouble& trouble = stage.troubles.at(shard);
    if (trouble.retry_at <= now && !is_left_to_others(job, stage, trouble, worker, now)) {
      return Run{order, index, shard, 1};
    }
  }
  return std::nullopt;
}

// Results of other workers that this one is to confirm; disputed ones first.
std::optional<Queue::Run> Queue::audit_run(std::uint64_t order, std::size_t index,
                                           const WorkerState& worker, std::uint64_t limit) const {
  const StageState& stage = jobs_.at(order).stages[index];
  for (const std::uint64_t shard : stage.disputed) {
    const Dispute& dispute = disputes_.at(stage.digests[shard]);
    if (dispute.attempt == 0 && !dispute.has_asked(worker.name)) {
      return Run{order, index, shard, 1, Purpose::kAudit};
    }
  }
  for (const auto& [author, shards] : stage.audits) {
    if (author_name(author) != worker.name) {
      const ShardRanges::Range range = shards.front();
      return Run{order, index, range.first,
                 std::min(std::max<std::uint64_t>(limit, 1), range.count), Purpose::kAudit};
    }
  }
  return std::nullopt;
}

// For a worker that has nothing else to do: the end of a run that takes too long elsewhere.
std::optional<Queue::Run> Queue::second_run(const WorkerState& worker, Time now) const {
  for (const std::uint64_t id : slow_) {
    const Attempt& attempt = attempts_.at(id);
    const JobState& job = *this->job(attempt.job);
    const StageState& stage = job.stages[attempt.stage];
    if (attempt.worker == worker.id || stage.pending() > 0 ||
        hindrance(worker, job, stage, now).obstacle != Obstacle::kNone) {
      continue;
    }
    const std::uint64_t limit = sized(stage, worker, 0, now);
    const auto is_open = [&](std::uint64_t shard) {
      return stage.shards[shard] == ShardState::kRunning && !stage.doubled.contains(shard);
    };
    std::uint64_t end = attempt.first_shard + attempt.shards;
    while (end > attempt.first_shard && !is_open(end - 1)) {
      --end;
    }
    std::uint64_t first = end;
    while (first > attempt.first_shard && end - first < limit && is_open(first - 1)) {
      --first;
    }
    if (first < end) {
      return Run{order_of_job_.at(job.id), attempt.stage, first, end - first,
                 Purpose::kSpeculation};
    }
  }
  return std::nullopt;
}

// How many pending shards to give at once; 0: leave what there is to workers that have nothing.
std::uint64_t Queue::run_size(const JobState& job, const StageState& stage,
                              const WorkerState& worker, bool is_busy, Time now) const {
  const auto pool = pools_.find(*job.fingerprint);
  CHECK(pool != pools_.end());
  // Of the others.
  const std::uint64_t idle = pool->second.idle - (worker.is_counted_idle ? 1 : 0);
  const std::uint64_t idle_threads =
      pool->second.idle_threads - (worker.is_counted_idle ? worker.threads : 0);
  const std::uint64_t pending = stage.pending();
  if (is_busy && pending <= idle_threads) {
    const bool can_others = std::any_of(workers_.begin(), workers_.end(), [&](const auto& entry) {
      return entry.second.is_counted_idle && entry.first != worker.id &&
             hindrance(entry.second, job, stage, now).obstacle == Obstacle::kNone;
    });
    if (can_others) {
      return 0;
    }
  }
  const std::uint64_t per_thread =
      std::min<std::uint64_t>(worker.threads, ceil_div(pending, 1 + idle));
  if (stage.shard_thread_ms <= 0) {
    return std::max<std::uint64_t>(per_thread, 1);  // the first runs of a stage measure it
  }
  // Large runs first, smaller ones towards the end, so that the workers end together.
  const std::uint64_t share = ceil_div(pending, 2 * pool->second.workers);
  return std::max(per_thread, sized(stage, worker, share, now));
}

// As many shards as the worker does in target_run_ms, but no more than its share, or than it does
// in last_run_ms if that is more (a share of 0: no limit); and no more than it has time for.
std::uint64_t Queue::sized(const StageState& stage, const WorkerState& worker, std::uint64_t share,
                           Time now) const {
  if (stage.shard_thread_ms <= 0) {
    return worker.threads;
  }
  const double per_ms = static_cast<double>(worker.threads) / stage.shard_thread_ms;
  const auto shards_in = [&](double ms) {
    const double shards =
        std::clamp(per_ms * ms, 0.0, static_cast<double>(settings_.run_limit_shards));
    return static_cast<std::uint64_t>(shards);
  };
  std::uint64_t size = shards_in(settings_.target_run_ms);
  if (share > 0) {
    size = std::min(size, std::max(share, shards_in(settings_.last_run_ms)));
  }
  size = std::max<std::uint64_t>(size, share > 0 ? 1 : worker.threads);
  if (worker.wall_left_ms != 0) {
    size = std::min(size, shards_in(wall_left_ms(worker, now)));
  }
  return std::max<std::uint64_t>(size, 1);
}

}  // namespace weft::coordinator
