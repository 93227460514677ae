#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/queue_events.h"

// What the queue remembers. Values only: a copy is a snapshot.

namespace weft::coordinator {

enum class ShardState : std::uint8_t { kPending, kRunning, kDone };

// What went wrong with one shard so far. A shard in trouble is run alone.
struct ShardTrouble {
  std::uint32_t failures = 0;
  std::uint32_t losses = 0;         // workers lost while they held it
  std::uint32_t lonely_losses = 0;  // ... in a run of its own
  Time retry_at{};
  std::set<std::string> workers;                          // on which it failed
  std::map<std::string, std::set<std::string>> messages;  // error -> workers
};

struct Backoff {
  Time until{};
  std::uint32_t step_ms = 0;
};

// How far a stage was at a time, running shards' shares included.
struct RateSample {
  Time at{};
  double shards = 0;
};

struct StageState {
  StageName name = StageName::kGeometry;
  std::vector<core::Digest> digests;
  std::vector<ShardState> shards;
  std::vector<core::Digest> results;  // where done
  std::uint64_t done = 0;             // cached ones included
  std::uint64_t cached = 0;
  std::uint64_t running = 0;
  std::uint64_t failures = 0;
  std::uint64_t first_pending = 0;  // no shard below is pending
  std::map<std::uint64_t, ShardTrouble> troubles;
  std::set<std::uint64_t> attempts;         // live ones
  std::map<std::string, Backoff> backoffs;  // by worker
  double shard_thread_ms = 0;               // measured work of a shard on one thread; 0: unknown
  std::deque<RateSample> rate;
  Time started_at{};
  Time ended_at{};

  [[nodiscard]] bool is_done() const { return done == shards.size(); }
  [[nodiscard]] std::uint64_t pending() const { return shards.size() - done - running; }
};

enum class JobPhase : std::uint8_t {
  kQueued,
  kRunning,
  kCommitting,
  kSucceeded,
  kFailed,
  kCancelled
};

// A shard that its job gave up, or of which two workers gave different results.
struct Trouble {
  enum class Kind : std::uint8_t { kQuarantined, kKiller, kMismatch };
  Kind kind = Kind::kQuarantined;
  StageName stage = StageName::kGeometry;
  std::uint64_t shard = 0;
  std::string message;               // in words: what, how often, where
  std::vector<std::string> workers;  // names of those concerned, sorted
  std::uint64_t attempt = 0;         // the last one, for its log; 0: unknown
  std::string liar;                  // of a mismatch: who was wrong, when that is known
};

struct JobState {
  std::string id;
  std::string fabric;
  JobPhase phase = JobPhase::kQueued;
  std::optional<core::Digest> fingerprint;
  Time served_at{};              // when a worker of its fingerprint was last there
  std::uint32_t generation = 0;  // counts beginnings: answers to older ones are dropped
  bool planning = false;
  bool plan_again = false;  // something ended since the plan that is being made was asked for
  std::vector<StageState> stages;  // in the order they were planned
  std::string error;
  JobDemands demands;
  bool is_paused = false;
  Time submitted_at{};
  Time started_at{};
  Time ended_at{};
  std::uint64_t revision = 0;
  std::vector<Trouble> troubles;  // the oldest first
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
  // As its worker says.
  std::uint64_t shards_done = 0;
  std::uint64_t progress = 0;
  Time progress_at{};  // when one of these two last changed
  std::string last_line;
};

struct WorkerState {
  std::string id;
  std::string name;
  std::uint32_t threads = 1;
  std::uint64_t memory_bytes = 0;
  core::Digest fingerprint;
  Time seen_at{};
  std::uint64_t shards_done = 0;
  std::uint64_t failures = 0;
  std::vector<std::string> labels;
  std::uint64_t wall_left_ms = 0;  // when it was last seen; 0: no limit
  std::vector<core::Digest> scenes;
  std::uint64_t superseded = 0;  // attempts of which it reported when they were no longer its own
  // Attempts about which all was said, for as long as the worker goes on naming them.
  std::set<std::uint64_t> settled;
};

}  // namespace weft::coordinator
