#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/clock.h"
#include "proto/weft/v1/cluster.pb.h"
#include "worker/attempt_log.h"

namespace weft::worker {

// A run of shards that the coordinator gave us, and how far we are. Shared between the table and
// the threads that compute its shards: either may be done with it first. Guarded by the table's
// owner, but for the log and what is atomic.
struct Attempt {
  v1::Assignment assignment;
  std::uint64_t begun = 0;        // shards of the run that were claimed
  std::uint64_t in_progress = 0;  // of those: neither delivered nor given up
  std::vector<v1::ShardResult> results;
  std::optional<v1::TaskError> error;
  std::optional<core::Stopwatch> since_first_shard;
  std::uint64_t prepare_ms = 0;
  std::uint64_t work_ms = 0;  // wall time from the first shard to the last, preparing aside
  bool is_closing = false;    // no further shard is to be begun
  bool is_revoked = false;    // the coordinator does not want it any more
  std::atomic<bool> should_stop{false};
  std::atomic<bool> is_over{false};  // nothing of it runs any more
  // Rises whenever a thread that computes a shard of it gets on.
  std::atomic<std::uint64_t> progress{0};
  AttemptLog log;
};

// "job=... attempt=... stage=...": the attempt in a log line.
[[nodiscard]] std::string log_name(const Attempt& attempt);

// One shard to compute.
struct ShardClaim {
  std::shared_ptr<Attempt> attempt;
  std::uint64_t shard = 0;  // of the stage
};

// What this worker holds, runs and has to report: the worker's half of WorkerService.Synchronize.
// No threads, no clock, no network; its owner brings a lock.
class AttemptTable {
 public:
  explicit AttemptTable(unsigned threads) : threads_(threads) {}

  // Writes `running`, `completions` and `free_attempts`. A run is sized for all threads, so one
  // that is begun and one to go on with are enough; runs of few shards leave room for more.
  void fill(v1::SynchronizeRequest& request) const;

  // What an answer changed.
  struct Changes {
    std::vector<std::shared_ptr<Attempt>> assigned;
    std::vector<std::shared_ptr<Attempt>> revoked;
    std::uint64_t acknowledged = 0;
  };
  Changes apply(const v1::SynchronizeResponse& response);

  // The next shard, of the attempt that came first; nothing when there is none.
  [[nodiscard]] std::optional<ShardClaim> claim();

  // An attempt of a process that died: `earlier` names it and the results that it had stored with
  // the coordinator, and for `undelivered` further ones claims of it are about to be delivered. It
  // is never listed as running, since it owns nothing; what it finished is reported.
  std::shared_ptr<Attempt> take_over(const v1::Completion& earlier, std::uint64_t undelivered);

  // The three ends of a claimed shard. Each says whether the attempt is over: it is then in the
  // completions, or forgotten.
  bool delivered(const ShardClaim& claim, v1::ShardResult result);
  bool failed(const ShardClaim& claim, v1::TaskError error);
  bool given_up(const ShardClaim& claim);

  // What keeps results from being delivered, in words: nothing more is asked for meanwhile. Empty:
  // nothing. Says whether that is news to the coordinator.
  bool set_undelivered(std::string why);

  // Begins nothing more, asks running shards to stop, and takes no further attempts.
  void drain();

  // How many further attempts it would take now.
  [[nodiscard]] std::uint32_t free_attempts() const;
  [[nodiscard]] bool is_empty() const { return attempts_.empty() && completions_.empty(); }
  [[nodiscard]] std::uint64_t unacknowledged() const { return completions_.size(); }

  // Attempts of which nothing is left to say, since the last such call.
  [[nodiscard]] std::vector<v1::AttemptName> take_forgotten() {
    return std::exchange(forgotten_, {});
  }

 private:
  using Name = std::pair<std::string, std::uint64_t>;  // job, attempt

  void close(Attempt& attempt);
  bool end_if_over(const std::shared_ptr<Attempt>& attempt);

  unsigned threads_;
  bool is_draining_ = false;
  std::string undelivered_;
  std::vector<std::shared_ptr<Attempt>> attempts_;  // in the order they came
  std::map<Name, v1::Completion> completions_;
  std::vector<v1::AttemptName> forgotten_;
};

}  // namespace weft::worker
