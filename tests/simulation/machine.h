#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/digest.h"
#include "proto/weft/v1/cluster.pb.h"
#include "tests/simulation/checks.h"
#include "tests/simulation/coordinator_model.h"
#include "tests/simulation/ground.h"
#include "worker/attempt_table.h"

namespace weft::simulation {

// What a machine is like.
struct Character {
  std::string name;
  unsigned threads = 1;
  std::uint64_t memory_bytes = std::uint64_t{8} << 30;
  std::uint64_t slowness = 1;
  core::Digest fingerprint;
  std::vector<std::string> labels;
  std::uint64_t wall_limit_ms = 0;  // its process ends by itself before; 0: it does not
  std::optional<StageName> fails;   // every shard of this kind fails here, and only here
  bool lies = false;                // its results are wrong
};

// Shards that are at fault themselves, wherever they run.
struct BadShard {
  std::string cloth;
  std::string stage;
  std::uint64_t shard = 0;
  bool kills = false;  // its worker dies; else it fails
};

// A machine with a worker on it, as worker::LeaseLoop makes one around the real attempt table. What
// was computed and is not acknowledged lies on its disk, for the worker's next process.
class Machine {
 public:
  Machine(Ground& ground, Checks& checks, CoordinatorModel& coordinator, Character character,
          const std::vector<BadShard>& bad_shards)
      : ground_(ground),
        checks_(checks),
        coordinator_(coordinator),
        character_(std::move(character)),
        bad_shards_(bad_shards) {}

  [[nodiscard]] const Character& character() const { return character_; }
  [[nodiscard]] bool is_up() const { return process_ != nullptr; }
  [[nodiscard]] std::string worker_id() const;
  void start();
  void kill();                         // the process, at once
  void leave();                        // SIGTERM
  void freeze(std::uint64_t for_ms);   // SIGSTOP, SIGCONT
  void cut_off(std::uint64_t for_ms);  // nothing comes through in either direction
  // As far as the machine is concerned, all faults are over.
  void mend();

  // Nothing is left to do or to report.
  [[nodiscard]] bool is_idle() const;

 private:
  using Name = std::pair<std::string, std::uint64_t>;
  // Of one attempt, as worker::Spool keeps it.
  struct Spooled {
    v1::Completion completion;                     // names it, and what was uploaded
    std::map<std::uint64_t, std::string> waiting;  // results to upload, by shard
  };
  struct Process {
    explicit Process(unsigned threads) : table(threads) {}
    worker::AttemptTable table;
    std::set<Name> begun;
    std::set<Name> told;           // completions
    std::set<std::string> inputs;  // digests that it has read
    unsigned busy = 0;             // threads
    std::uint64_t sequence = 0;
    std::uint64_t call = 0;  // the sequence that is waited for; 0: none
    std::uint64_t back_off_ms = 0;
    std::uint32_t free_told = 0;
    bool is_leaving = false;
    std::uint32_t wait_ms = 1000;
    std::uint64_t started_ms = 0;
  };

  void later(std::uint64_t delay_ms, std::function<void()> action);
  void run_alive(std::uint64_t life, const std::function<void()>& action);
  [[nodiscard]] bool is_cut_off() const;
  // A call of the coordinator that answers true, or fails in one of many ways.
  void call_coordinator(const std::function<void()>& call, const std::function<void()>& refused);

  void synchronize();
  [[nodiscard]] v1::SynchronizeRequest next_request();
  void answered(std::uint64_t sequence, const v1::SynchronizeResponse& response);
  void unanswered(std::uint64_t sequence);
  void tell_news();
  void end();

  void work();
  void prepare(const worker::ShardClaim& claim, std::uint64_t tries);
  void bake(const worker::ShardClaim& claim);
  void finish(const worker::ShardClaim& claim);
  void upload(const worker::ShardClaim& claim, const std::string& bytes, std::uint64_t tries);
  void fail(const worker::ShardClaim& claim, v1::ErrorKind kind, const std::string& message);
  void give_up(const worker::ShardClaim& claim);
  void thread_is_free();
  void attempt_is_over();
  void take_over_spool();
  void put_into_spool(const worker::ShardClaim& claim, const std::string& bytes);
  void uploaded(const worker::ShardClaim& claim, const v1::ShardResult& result);
  void not_uploaded(const worker::ShardClaim& claim);
  [[nodiscard]] core::Digest work_of_claim(const worker::ShardClaim& claim) const;
  [[nodiscard]] const BadShard* bad_shard(const worker::ShardClaim& claim) const;

  Ground& ground_;
  Checks& checks_;
  CoordinatorModel& coordinator_;
  const Character character_;
  const std::vector<BadShard>& bad_shards_;
  std::uint64_t life_ = 0;
  std::uint64_t starts_ = 0;
  std::uint64_t frozen_until_ms_ = 0;
  std::uint64_t cut_off_until_ms_ = 0;
  std::map<Name, Spooled> spool_;  // on its disk
  std::unique_ptr<Process> process_;
};

}  // namespace weft::simulation
