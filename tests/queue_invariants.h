#pragma once

#include <map>

#include <gtest/gtest.h>

#include "coordinator/queue/queue.h"

namespace weft::coordinator {

// What holds of one stage of an unfinished job at any time.
inline void check_stage(const Queue& queue, const JobState& job, const StageState& stage) {
  std::map<ShardState, std::uint64_t> count;
  std::map<std::uint64_t, std::uint64_t> runs;  // attempts that own a running shard
  std::uint64_t audited = 0;
  for (const std::uint64_t id : stage.attempts) {
    const Attempt& attempt = queue.attempts().at(id);
    for (std::uint64_t i = attempt.first_shard; i < attempt.first_shard + attempt.shards; ++i) {
      if (attempt.purpose == Purpose::kAudit) {
        audited += stage.auditing.contains(i) ? 1 : 0;
      } else {
        runs[i] += attempt.skipped.contains(i) ? 0 : 1;
      }
    }
  }
  ASSERT_EQ(audited, stage.auditing.size());
  for (std::uint64_t i = 0; i < stage.shards.size(); ++i) {
    const ShardState state = stage.shards[i];
    ++count[state];
    std::uint64_t places = stage.fresh.contains(i) ? 1 : 0;
    for (const ShardRanges& suspects : stage.suspects) {
      places += suspects.contains(i) ? 1 : 0;
    }
    const auto trouble = stage.troubles.find(i);
    if (trouble != stage.troubles.end()) {
      places += stage.retries.contains({trouble->second.retry_at, i}) ? 1 : 0;
      places += stage.deadly.contains({trouble->second.lone_losses.size(), i}) ? 1 : 0;
      ASSERT_FALSE(trouble->second.is_empty()) << i;
      ASSERT_NE(state, ShardState::kDone) << i;
    }
    ASSERT_EQ(places, state == ShardState::kPending ? 1U : 0U) << "shard " << i;
    if (state == ShardState::kRunning) {
      const auto doubled = stage.doubled.find(i);
      ASSERT_EQ(runs[i], 1 + (doubled == stage.doubled.end() ? 0 : doubled->second)) << i;
    } else {
      ASSERT_FALSE(stage.doubled.contains(i)) << i;
    }
    if (state == ShardState::kPending) {
      ASSERT_EQ(runs[i], 0U) << i;
    }
  }
  ASSERT_EQ(count[ShardState::kRunning], stage.running);
  ASSERT_EQ(count[ShardState::kDone], stage.done);
  ASSERT_EQ(count[ShardState::kElsewhere], stage.elsewhere);
  ASSERT_EQ(count[ShardState::kQuarantined], stage.quarantined);
  ASSERT_EQ(stage.retries.size() + stage.deadly.size() + stage.fresh.size() +
                stage.suspects[0].size() + stage.suspects[1].size() + stage.suspects[2].size(),
            stage.pending());
  const bool has_work = stage.pending() > 0 || !stage.audits.empty() || !stage.disputed.empty();
  ASSERT_TRUE(!has_work || job.is_ready || job.is_paused || job.phase == JobPhase::kCommitting);
}

inline void check_queue(const Queue& queue, Time now) {
  for (const JobState* job : queue.jobs()) {
    if (job->has_ended()) {
      continue;
    }
    for (const StageState& stage : job->stages) {
      ASSERT_NO_FATAL_FAILURE(check_stage(queue, *job, stage))
          << job->id << " " << to_string(stage.name);
    }
  }
  for (const auto& [id, attempt] : queue.attempts()) {
    ASSERT_GE(attempt.lease_until, now);
    const JobState* const job = queue.job(attempt.job);
    ASSERT_NE(job, nullptr);
    ASSERT_FALSE(job->has_ended() || job->is_paused);
    ASSERT_TRUE(job->stages[attempt.stage].attempts.contains(id));
  }
}

}  // namespace weft::coordinator
