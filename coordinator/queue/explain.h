#pragma once

#include <cstdint>
#include <string>

#include "coordinator/queue/queue.h"
#include "proto/weft/v1/cluster.pb.h"

// Why a job, a task or a worker does what it does, or nothing: asked of the very predicates by
// which the queue gives work. Pure functions of the queue's state.

namespace weft::coordinator {

// What Reason.code may be. Programs rely on them: they are never renamed.
namespace reason {
// What drives the subject.
inline constexpr const char* kRunning = "running";
inline constexpr const char* kPlanning = "planning";
inline constexpr const char* kCommitting = "committing";
inline constexpr const char* kEnded = "ended";
inline constexpr const char* kDone = "done";
inline constexpr const char* kDue = "due";  // the next report of a worker takes it
// What holds back a job or a stage of it.
inline constexpr const char* kPaused = "paused";
inline constexpr const char* kNoWorker = "no_worker";
inline constexpr const char* kWorkersBusy = "workers_busy";
inline constexpr const char* kWaitsForStage = "waits_for_stage";
inline constexpr const char* kRunsElsewhere = "runs_elsewhere";  // equal work of another job
inline constexpr const char* kRetry = "retry";
inline constexpr const char* kLeftToOthers = "left_to_others";
inline constexpr const char* kSuspect = "suspect";  // was with a worker that was lost
inline constexpr const char* kQuarantined = "quarantined";
inline constexpr const char* kAwaitsAudit = "awaits_audit";
inline constexpr const char* kMismatch = "mismatch";
inline constexpr const char* kAuditsGivenUp = "audits_given_up";
// What keeps a worker from a stage; `worker` says whom.
inline constexpr const char* kLost = "lost";
inline constexpr const char* kOtherNumerics = "other_numerics";
inline constexpr const char* kLabels = "labels";
inline constexpr const char* kMemory = "memory";
inline constexpr const char* kDrained = "drained";
inline constexpr const char* kBlocked = "blocked";
inline constexpr const char* kBackingOff = "backing_off";
inline constexpr const char* kFailing = "failing";
inline constexpr const char* kMemoryHeld = "memory_held";
inline constexpr const char* kWallTime = "wall_time";
// Of a worker.
inline constexpr const char* kNoWork = "no_work";
}  // namespace reason

[[nodiscard]] v1::ExplainResponse explain_job(const Queue& queue, const JobState& job, Time now);
// `stage` by its name. A stage or shard that is not planned yet is explained as waiting.
[[nodiscard]] v1::ExplainResponse explain_task(const Queue& queue, const JobState& job,
                                               const std::string& stage, std::uint64_t shard,
                                               Time now);
[[nodiscard]] v1::ExplainResponse explain_worker(const Queue& queue, const WorkerState& worker,
                                                 Time now);

}  // namespace weft::coordinator
