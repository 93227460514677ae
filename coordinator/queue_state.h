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
  std::string worker;
  std::string token;
  Time lease_until{};
  std::uint64_t shards_done = 0;  // as its worker says
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
};

}  // namespace weft::coordinator
