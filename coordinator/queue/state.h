#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/queue/events.h"
#include "coordinator/queue/ranges.h"
#include "coordinator/queue/verdicts.h"

// What the queue remembers. Values only: a copy is a snapshot.

namespace weft::coordinator {

enum class ShardState : std::uint8_t {
  kPending,
  kRunning,
  kElsewhere,  // equal work of another job is running; its result will be this one's too
  kDone,
  kQuarantined,  // given up, unless a result comes all the same
};

// Why a worker gets nothing of a stage for a while.
struct Backoff {
  Time until{};
  std::uint32_t step_ms = 0;   // of the last wait for a resource; 0: there was none
  std::uint32_t failures = 0;  // in a row
  bool is_short = false;       // a resource is short; else it failed again and again
};

// How far a stage was at a time, running shards' shares included.
struct RateSample {
  Time at{};
  double shards = 0;
};

// Shards whose run was lost with its worker are given in shorter and shorter runs, so that one that
// kills its workers is found: at most so many shards after the first loss, the second, the third.
inline constexpr std::array<std::uint64_t, 3> kSuspectRunShards = {256, 16, 1};

struct StageState {
  StageName name = StageName::kGeometry;
  core::Digest scene;
  std::uint64_t memory_bytes = 0;
  std::vector<core::Digest> digests;
  std::vector<ShardState> shards;
  std::vector<core::Digest> results;   // where done
  std::vector<std::uint32_t> authors;  // of the results: Queue::author_name
  std::uint64_t done = 0;              // cached ones included
  std::uint64_t cached = 0;
  std::uint64_t running = 0;
  std::uint64_t elsewhere = 0;
  std::uint64_t quarantined = 0;
  std::uint64_t failures = 0;

  // Each pending shard is in one of these: without any trouble; in a run that was lost, by how
  // often; failed, by when it may be tried again; lost alone, by how often.
  ShardRanges fresh;
  std::array<ShardRanges, kSuspectRunShards.size()> suspects;
  std::set<std::pair<Time, std::uint64_t>> retries;
  std::set<std::pair<std::size_t, std::uint64_t>> deadly;

  std::map<std::uint64_t, ShardTrouble> troubles;  // of shards that are not done
  std::map<std::uint64_t, std::uint32_t> doubled;  // running shards: further attempts that run them
  std::set<std::uint64_t> attempts;                // live ones

  // Done shards whose result another worker is to confirm: by the author of the result, those that
  // wait for it, and those that are running; how often it could not be done; and those of which two
  // results differ.
  std::map<std::uint32_t, ShardRanges> audits;
  ShardRanges auditing;
  std::map<std::uint64_t, std::uint32_t> audit_failures;
  std::set<std::uint64_t> disputed;
  Time audits_possible_at{};  // when there last was a worker that can do them

  std::map<std::string, Backoff> backoffs;  // by worker's id
  double shard_thread_ms = 0;               // measured work of a shard on one thread; 0: unknown
  std::deque<RateSample> rate;
  Time started_at{};
  Time ended_at{};

  [[nodiscard]] bool is_done() const { return done == shards.size(); }
  [[nodiscard]] std::uint64_t pending() const {
    return shards.size() - done - running - elsewhere - quarantined;
  }
  // Done shards that are not to be relied on yet.
  [[nodiscard]] std::uint64_t unconfirmed() const;
  [[nodiscard]] bool awaits_audit(std::uint64_t shard) const;
  // Nobody is to be asked about the shard any more; says whether somebody was.
  bool withdraw_audit(std::uint64_t shard);
};

enum class JobPhase : std::uint8_t {
  kQueued,
  kRunning,
  kCommitting,
  kSucceeded,
  kFailed,
  kCancelled
};

struct JobState {
  std::string id;
  std::string fabric;
  JobPhase phase = JobPhase::kQueued;
  std::optional<core::Digest> fingerprint;
  Time served_at{};              // when a worker of its fingerprint was last there
  std::uint32_t generation = 0;  // counts beginnings: answers to older ones are dropped
  std::uint32_t results_lost = 0;
  bool planning = false;
  bool plan_again = false;  // something ended since the plan that is being made was asked for
  bool is_planned = false;  // nothing is left to plan; it is committed when all is confirmed
  std::vector<StageState> stages;  // in the order they were planned
  std::string error;
  JobDemands demands;
  bool is_paused = false;
  bool is_ready = false;  // it has something for a worker
  Time waiting_since{};   // when it was last given work, or had some again
  Time submitted_at{};
  Time started_at{};
  Time ended_at{};
  std::uint64_t revision = 0;
  std::vector<Trouble> troubles;  // the oldest first
  // Of before a restart, without a verdict: others are asked again when their stage is planned.
  std::vector<MismatchRecord> open_mismatches;
  // Since the coordinator's start: reports of attempts that owned nothing any more, and the results
  // taken from them; attempts of the two other purposes; audits that nobody could do.
  std::uint64_t superseded_attempts = 0;
  std::uint64_t superseded_results_used = 0;
  std::uint64_t speculative_attempts = 0;
  std::uint64_t audited_shards = 0;
  std::uint64_t audits_given_up = 0;

  [[nodiscard]] bool has_ended() const {
    return phase == JobPhase::kSucceeded || phase == JobPhase::kFailed ||
           phase == JobPhase::kCancelled;
  }
  [[nodiscard]] std::uint64_t quarantined() const;
  [[nodiscard]] std::uint64_t unconfirmed() const;
};

struct Attempt {
  std::uint64_t id = 0;
  std::string job;
  std::size_t stage = 0;  // index into JobState::stages
  std::uint64_t first_shard = 0;
  std::uint64_t shards = 0;
  std::string worker;  // id
  std::string worker_name;
  Purpose purpose = Purpose::kFirst;
  std::string token;
  Time lease_until{};
  Time began_at{};
  Time active_at{};  // since when its worker has nothing older to do; the epoch: it has
  // As its worker says.
  std::uint64_t shards_done = 0;
  std::uint64_t progress = 0;
  Time progress_at{};  // when one of these two last changed
  std::string last_line;
  std::set<std::uint64_t> skipped;  // shards within its run that were not free when it began
  std::size_t losses = 0;           // of runs that these shards were in
  double charged_ms = 0;            // to its job, in milliseconds of one thread
};

struct WorkerState {
  std::string id;
  std::string name;
  std::uint32_t threads = 1;
  std::uint64_t memory_bytes = 0;
  core::Digest fingerprint;
  Time seen_at{};
  bool is_disconnected = false;
  std::uint64_t shards_done = 0;
  std::uint64_t failures = 0;
  std::vector<std::string> labels;
  std::uint64_t wall_left_ms = 0;  // when it was last seen; 0: no limit
  std::vector<core::Digest> scenes;
  std::string undelivered;       // what keeps its results from us; empty: nothing
  std::uint64_t superseded = 0;  // attempts of which it reported when they were no longer its own
  // Attempts about which all was said, for as long as the worker goes on naming them.
  std::set<std::uint64_t> settled;
  // How it is counted in its pool.
  bool is_counted = false;
  bool is_counted_idle = false;
};

// The workers of one fingerprint that are there and not drained.
struct WorkerPool {
  std::uint64_t workers = 0;
  std::uint64_t idle = 0;  // of these, those that run nothing
  std::uint64_t idle_threads = 0;
};

// Different results of one deterministic shard, until most of those asked agree.
struct Dispute {
  struct Opinion {
    std::string worker;  // name
    core::Digest result;
    std::uint64_t size_bytes = 0;
  };
  StageName stage = StageName::kGeometry;
  std::vector<Opinion> opinions;  // the recorded one first
  std::set<std::uint64_t> jobs;   // by order: those that use it
  std::uint64_t attempt = 0;      // that will say more; 0: none runs
  Time possible_at{};             // when there last was a worker that could be asked

  [[nodiscard]] bool has_asked(const std::string& worker) const;
};

}  // namespace weft::coordinator
