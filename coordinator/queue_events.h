#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "coordinator/plan.h"
#include "core/clock.h"
#include "core/digest.h"

// What the queue is told and what it answers: plain values, so that a whole cluster can be played
// in one thread and virtual time.

namespace weft::coordinator {

using Time = core::Clock::Time;

struct QueueSettings {
  std::uint32_t lease_ms = 30'000;
  // Runs are sized to this much wall time, as measured, and to no less than shortest_run_ms when
  // the last shards of a stage are shared out.
  std::uint32_t target_run_ms = 20'000;
  std::uint32_t shortest_run_ms = 5'000;
  std::uint64_t run_limit_shards = 4'096;
  // A shard is quarantined, and its job fails, after so many failures, or the same error on so many
  // workers, or so many lost workers that ran nothing else of the stage beside it.
  std::uint32_t failure_limit = 5;
  std::uint32_t same_error_limit = 3;
  std::uint32_t lonely_loss_limit = 5;
  std::uint32_t retry_ms = 1'000;          // doubles with each failure of the shard
  std::uint32_t short_ms = 5'000;          // back-off when a resource is short; doubles up to ...
  std::uint32_t short_limit_ms = 300'000;  // ... this
  std::uint32_t rebind_ms = 60'000;        // how long a job waits for workers of its fingerprint
  std::uint32_t forget_worker_ms = 600'000;
  std::uint32_t reset_limit = 10;  // how often a job may begin again because a result was lost
};

// ---- events

struct SubmitEvent {
  std::string job;
  std::string fabric;
  std::optional<core::Digest> fingerprint;  // of a job that was bound before a restart
  Time submitted_at{};
};

struct CancelEvent {
  std::string job;
};

// A failure that was recorded before a restart.
struct PriorFailure {
  std::uint64_t shard = 0;
  std::string worker;
  std::string message;
};

struct KnownResult {
  std::uint64_t shard = 0;
  core::Digest result;
};

struct PlannedStage {
  StageName name = StageName::kGeometry;
  std::vector<core::Digest> digests;  // of the shards' work, by index
  std::vector<KnownResult> known;     // results that need not be computed
  std::vector<PriorFailure> failures;
};

// The answer to Actions::plan. Nothing in `stages` while every stage that there is has ended means
// that the job is complete.
struct PlannedEvent {
  std::string job;
  std::uint32_t generation = 0;
  std::vector<PlannedStage> stages;
};

// Planning or committing failed for good, or committing is over.
struct JobFailedEvent {
  std::string job;
  std::uint32_t generation = 0;
  std::string error;
};
struct CommittedEvent {
  std::string job;
  std::uint32_t generation = 0;
};

// A result is damaged or gone: what needs it begins again.
struct ResultLostEvent {
  core::Digest result;
};

struct RunningClaim {
  std::string job;
  std::uint64_t attempt = 0;
  std::string token;
  std::uint64_t shards_done = 0;
};

struct ShardResult {
  std::uint64_t shard = 0;
  core::Digest digest;
  std::uint64_t size_bytes = 0;
};

struct Failure {
  bool resource_short = false;
  std::uint64_t shard = 0;
  std::string message;
};

struct CompletionClaim {
  std::string job;
  std::uint64_t attempt = 0;
  std::string token;
  std::vector<ShardResult> results;  // verified: their blobs are there
  std::optional<Failure> failure;
  std::uint64_t work_ms = 0;
};

// One Synchronize call; answered in Actions::reply.
struct ReportEvent {
  std::string worker;
  std::string name;
  std::uint32_t threads = 1;
  std::uint64_t memory_bytes = 0;
  core::Digest fingerprint;
  std::vector<RunningClaim> running;
  std::vector<CompletionClaim> completions;
  std::uint32_t free_attempts = 0;
  bool leaving = false;
};

// Time has passed.
struct TickEvent {};

using Event = std::variant<SubmitEvent, CancelEvent, PlannedEvent, JobFailedEvent, CommittedEvent,
                           ResultLostEvent, ReportEvent, TickEvent>;

// ---- actions

struct PlanAction {
  std::string job;
  std::uint32_t generation = 0;
  core::Digest fingerprint;
};

struct CommitAction {
  std::string job;
  std::uint32_t generation = 0;
};

struct AssignAction {
  std::string job;
  StageName stage = StageName::kGeometry;
  std::uint64_t attempt = 0;
  std::string token;
  std::uint64_t first_shard = 0;
  std::uint64_t shards = 0;
  std::uint32_t lease_ms = 0;
};

struct AttemptName {
  std::string job;
  std::uint64_t attempt = 0;
};

struct Reply {
  std::vector<AssignAction> assignments;
  std::vector<AttemptName> leases;
  std::vector<AttemptName> stop;
  std::vector<AttemptName> acknowledged;
};

// To be made durable before the reply that it came with is sent.
struct ResultRecord {
  core::Digest shard;  // names the work
  core::Digest result;
  std::uint64_t size_bytes = 0;
};
struct FailureRecord {
  std::string job;
  StageName stage = StageName::kGeometry;
  std::uint64_t shard = 0;
  std::string worker;
  std::string message;
};
struct BindRecord {
  std::string job;
  core::Digest fingerprint;
};

struct Actions {
  std::vector<PlanAction> plan;
  std::vector<CommitAction> commit;
  std::vector<ResultRecord> results;
  std::vector<FailureRecord> failures;
  std::vector<BindRecord> bound;
  std::vector<std::string> ended;  // jobs that have just ended, in whatever way
  bool wake = false;               // workers that wait may now get something
  Reply reply;                     // of a ReportEvent
};

}  // namespace weft::coordinator
