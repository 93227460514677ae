#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/queue/events.h"

// Who is at fault: the task or the worker. Workers are judged by their names, because a machine
// that starts its worker again is the same machine.

namespace weft::coordinator {

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

// A worker was lost while it ran this shard and nothing else of the stage.
struct LoneLoss {
  std::string worker;  // name
  Time at{};
  bool is_confirmed = false;  // it is known to survive other tasks
};

// What went wrong with one unfinished shard so far. Such a shard is run alone.
struct ShardTrouble {
  Time retry_at{};
  std::map<std::string, std::uint32_t> failures;          // by the worker's name
  std::map<std::string, std::set<std::string>> messages;  // error -> workers' names
  std::string last_message;
  std::vector<LoneLoss> lone_losses;
  std::uint64_t last_attempt = 0;

  [[nodiscard]] std::uint32_t failure_count() const;
  [[nodiscard]] bool is_empty() const { return failures.empty() && lone_losses.empty(); }
  // Forgets what happened on a worker; says whether there was anything.
  bool forgive(const std::string& worker);
};

// Why a shard is to be given up.
struct Verdict {
  Trouble::Kind kind = Trouble::Kind::kQuarantined;
  std::string message;
  std::vector<std::string> workers;
};

// The task is bad when it failed failure_limit times; or in the same way on same_error_limit
// workers; or in the same way on every worker that may run it (`eligible`, names), when these are
// two at least and it failed three times at least: one worker alone is no witness.
[[nodiscard]] std::optional<Verdict> judge_failures(const ShardTrouble& trouble,
                                                    const std::set<std::string>& eligible,
                                                    const QueueSettings& settings);

// The task kills its workers when lonely_loss_limit of them that survive other tasks were lost
// while they ran it alone, or unconfirmed_loss_limit of whichever. A worker that was lost
// `elsewhere` (by name) as often dies of something else: each such loss outweighs one of these. At
// hopeless_loss_limit nothing does.
[[nodiscard]] std::optional<Verdict> judge_losses(
    const ShardTrouble& trouble, const std::map<std::string, std::size_t>& elsewhere,
    const QueueSettings& settings);

// How one worker does with one kind of task.
struct Conduct {
  std::uint64_t passed = 0;            // shards
  std::uint64_t passed_elsewhere = 0;  // shards that failed here and then passed on another worker

  // The worker is bad when block_limit shards failed here that passed elsewhere, and these are more
  // than one in twenty of those that passed here: a good worker is not blocked for its age.
  [[nodiscard]] bool is_bad(const QueueSettings& settings) const {
    return passed_elsewhere >= settings.block_limit && passed_elsewhere * 20 > passed;
  }
};

}  // namespace weft::coordinator
