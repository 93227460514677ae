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
  // Runs are sized to this much wall time, as measured, and to no less than last_run_ms when the
  // last shards of a stage are shared out: so long is nobody idle at most while another ends.
  std::uint32_t target_run_ms = 20'000;
  std::uint32_t last_run_ms = 500;
  // What a run is taken for of whose stage nothing is measured.
  std::uint32_t unmeasured_run_ms = 5'000;
  std::uint64_t run_limit_shards = 4'096;
  // A shard is quarantined, and its job fails, after so many failures, or the same error on so many
  // workers, or so many lost workers that ran nothing else of the stage beside it.
  std::uint32_t failure_limit = 5;
  std::uint32_t same_error_limit = 3;
  std::uint32_t lonely_loss_limit = 5;
  // ... or so many lost workers of which nobody knows whether they survive other tasks.
  std::uint32_t unconfirmed_loss_limit = 10;
  // ... or so many, though these workers are lost with other tasks, too.
  std::uint32_t hopeless_loss_limit = 25;
  std::uint32_t retry_ms = 1'000;          // doubles with each failure of the shard
  std::uint32_t short_ms = 5'000;          // back-off when a resource is short; doubles up to ...
  std::uint32_t short_limit_ms = 300'000;  // ... this
  std::uint32_t rebind_ms = 60'000;        // how long a job waits for workers of its fingerprint
  std::uint32_t forget_worker_ms = 600'000;
  std::uint32_t reset_limit = 10;  // how often a job may begin again because a result was lost
  // A worker is blocked for a kind of task when so many different shards of that kind failed on it
  // and then passed elsewhere.
  std::uint32_t block_limit = 3;
  // A worker whose connection closed is lost after so long, unless it calls again.
  std::uint32_t disconnect_ms = 2'000;
  // An attempt hangs when its progress stands still for this long, or for hung_factor times what
  // its run was expected to take, whichever is more.
  std::uint32_t hung_ms = 600'000;
  std::uint32_t hung_factor = 10;
  // When nothing is pending, a run that takes longer than slow_factor times the time expected, and
  // at least slow_ms, is run a second time by an idle worker.
  std::uint32_t slow_factor = 3;
  std::uint32_t slow_ms = 10'000;
  std::uint32_t ageing_ms = 300'000;    // waiting so long is worth one step of priority
  std::uint32_t user_jobs_limit = 200;  // unfinished jobs of one user
  std::uint32_t quarantine_limit = 16;  // a job with so many quarantined shards ends at once
  std::uint32_t opinion_limit = 5;      // different results of a shard after which its job ends
  // A worker with a wall-time limit gets work of unknown duration only while it has so much left.
  std::uint32_t wall_margin_ms = 60'000;
  // When no event came for so long, or the clock went back, the coordinator itself stood still or
  // its clock was set: leases and waits then last as long as they still had to.
  std::uint32_t stall_ms = 15'000;
};

// What a job asks of the scheduler.
struct JobDemands {
  std::string user;
  std::int32_t priority = 0;        // -100 to 100
  double audit = 0;                 // share of the shards computed twice
  std::vector<std::string> labels;  // that a worker must have, all of them
};

// Two results of one deterministic shard differ: both workers are named, and the liar when it is
// known. A record, and told again after a restart.
struct MismatchRecord {
  std::string job;
  StageName stage = StageName::kGeometry;
  std::uint64_t shard = 0;
  std::string worker;
  core::Digest result;
  std::string other_worker;
  core::Digest other_result;
  std::string liar;  // empty: not yet known
};

// ---- events

struct SubmitEvent {
  std::string job;
  std::string fabric;
  std::optional<core::Digest> fingerprint;  // of a job that was bound before a restart
  Time submitted_at{};
  JobDemands demands;
  bool is_paused = false;
  std::vector<MismatchRecord> mismatches;  // found before a restart, in the order of their records
};

struct PauseEvent {
  std::string job;
  bool is_paused = true;
};

struct PriorityEvent {
  std::string job;
  std::int32_t priority = 0;
};

// Of a worker's name; also told of every such name after a restart.
struct DrainEvent {
  std::string worker_name;
  bool is_drained = true;
};

// Of a worker's name and kind of task; `is_blocked` only to restore what was recorded.
struct BlockEvent {
  std::string worker_name;
  StageName stage = StageName::kGeometry;
  bool is_blocked = false;
  bool is_liar = false;  // it gave wrong results
};

// The worker's connection has been closed for disconnect_ms.
struct DisconnectEvent {
  std::string worker;
};

struct CancelEvent {
  std::string job;
};

enum class TroubleKind : std::uint8_t {
  kFailed,
  kLost,      // its worker fell silent while it held the shard
  kLoneLoss,  // ... and held nothing else of the stage
  kHung,
};

// A failure that was recorded before a restart.
struct PriorFailure {
  TroubleKind kind = TroubleKind::kFailed;
  std::uint64_t shard = 0;
  std::string worker;  // name
  std::string message;
};

struct KnownResult {
  std::uint64_t shard = 0;
  core::Digest result;
  std::string worker;       // name of who computed it; empty: unknown
  bool is_audited = false;  // a second worker gave the same
};

enum class Purpose : std::uint8_t { kFirst, kSpeculation, kAudit };
[[nodiscard]] const char* to_string(Purpose purpose);

// An attempt that ran before a restart: it owns its shards until its lease, counted anew, is over.
struct PriorAttempt {
  std::uint64_t id = 0;
  std::uint64_t first_shard = 0;
  std::uint64_t shards = 0;
  std::string worker;  // id
  std::string worker_name;
  Purpose purpose = Purpose::kFirst;
};

// An attempt that was lost with its worker before a restart.
struct PriorLoss {
  std::string worker;  // id
  std::string worker_name;
  std::uint64_t first_shard = 0;
  std::uint64_t shards = 0;
  Time at{};
};

struct PlannedStage {
  StageName name = StageName::kGeometry;
  std::vector<core::Digest> digests;  // of the shards' work, by index
  std::vector<KnownResult> known;     // results that need not be computed
  std::vector<PriorFailure> failures;
  std::vector<PriorAttempt> attempts;
  std::vector<PriorLoss> losses;
  core::Digest scene;              // inputs[0]: workers that hold it come first; zero: none
  std::uint64_t memory_bytes = 0;  // what a worker needs for a run; 0: nothing to speak of
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
  std::uint64_t progress = 0;
  std::string last_line;
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
  std::vector<std::string> labels;
  std::uint64_t wall_left_ms = 0;    // 0: no limit
  std::vector<core::Digest> scenes;  // tiles whose scenes it holds
  std::string undelivered;           // what keeps its results from us; empty: nothing
};

// Time has passed.
struct TickEvent {};

using Event = std::variant<SubmitEvent, CancelEvent, PauseEvent, PriorityEvent, DrainEvent,
                           BlockEvent, DisconnectEvent, PlannedEvent, JobFailedEvent,
                           CommittedEvent, ResultLostEvent, ReportEvent, TickEvent>;

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
  Purpose purpose = Purpose::kFirst;
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
  std::string worker;  // name
};
// A result that proved to be wrong: its row is deleted.
struct ResultDropRecord {
  core::Digest shard;
  core::Digest result;
};
// A second worker gave the same result.
struct AuditRecord {
  core::Digest shard;
  std::string worker;  // name
};
struct FailureRecord {
  std::string job;
  StageName stage = StageName::kGeometry;
  std::uint64_t shard = 0;
  std::string worker;  // name
  std::string message;
  TroubleKind kind = TroubleKind::kFailed;
};
// Failures on a worker that was found to be at fault do not count any more.
struct FailuresDropRecord {
  std::string job;
  StageName stage = StageName::kGeometry;
  std::string worker;  // name
};
struct BlockRecord {
  std::string worker;  // name
  StageName stage = StageName::kGeometry;
  bool is_blocked = true;
  bool is_liar = false;  // it gave wrong results: none of its results of this kind are taken
};
// The same attempt may begin a second time: its worker came back with it when its lease was over
// and nobody else ran its shards. What was recorded of its first beginning and its end is kept.
struct AttemptRecord {
  std::string job;
  std::uint64_t attempt = 0;
  StageName stage = StageName::kGeometry;
  std::uint64_t first_shard = 0;
  std::uint64_t shards = 0;
  std::string worker;  // id
  std::string worker_name;
  Purpose purpose = Purpose::kFirst;
  std::int64_t began_at_ms = 0;
};
enum class Outcome : std::uint8_t { kSucceeded, kFailed, kLost, kHung, kSuperseded, kStopped };
[[nodiscard]] const char* to_string(Outcome outcome);
struct AttemptEndRecord {
  std::string job;
  std::uint64_t attempt = 0;
  Outcome outcome = Outcome::kSucceeded;
  std::uint64_t shards_done = 0;
  std::string message;
  std::int64_t ended_at_ms = 0;
};
struct BindRecord {
  std::string job;
  core::Digest fingerprint;
};

// All records of one event are made durable together. A shard's result may be dropped and another
// one recorded in the same event: results_dropped comes before results.
struct Actions {
  std::vector<PlanAction> plan;
  std::vector<CommitAction> commit;
  std::vector<ResultDropRecord> results_dropped;
  std::vector<ResultRecord> results;
  std::vector<FailureRecord> failures;
  std::vector<BindRecord> bound;
  std::vector<AuditRecord> audits;
  std::vector<FailuresDropRecord> failures_dropped;
  std::vector<BlockRecord> blocks;
  std::vector<AttemptRecord> attempts_begun;
  std::vector<AttemptEndRecord> attempts_ended;
  std::vector<MismatchRecord> mismatches;
  std::vector<std::string> ended;  // jobs that have just ended, in whatever way
  bool wake = false;               // workers that wait may now get something
  Reply reply;                     // of a ReportEvent
};

}  // namespace weft::coordinator
