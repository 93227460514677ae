#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/simulation/checks.h"
#include "tests/simulation/client.h"
#include "tests/simulation/coordinator_model.h"
#include "tests/simulation/ground.h"
#include "tests/simulation/machine.h"

namespace weft::simulation {

// What happens in a seed: jobs, machines, people, and how bad the weather is.
struct Scenario {
  coordinator::QueueSettings settings;
  Weather weather;
  std::uint64_t faults_ms = 0;   // how long they last
  std::uint64_t trouble_ms = 0;  // between two blows; 0: none
  std::vector<Character> machines;
  std::vector<BadShard> bad_shards;
  std::vector<JobRow> jobs;
  std::uint64_t spoilt_blobs = 0;  // at most
  bool has_clock_jumps = false;
};

[[nodiscard]] Scenario scenario_of(std::uint64_t seed);
// The same without any fault.
[[nodiscard]] Scenario calm(Scenario scenario);

struct Outcome {
  std::string problem;  // empty: none
  std::uint64_t at_ms = 0;
  std::uint64_t events = 0;                       // of the queue
  std::map<std::string, core::Digest> databases;  // of jobs that succeeded
  std::uint64_t crashes = 0;
};

// One cluster from its first job to its last.
class World {
 public:
  World(std::uint64_t seed, Scenario scenario, bool is_traced);
  [[nodiscard]] Outcome run();

 private:
  void arrange_jobs();
  void arrange_orders(const std::string& job);
  void arrange_drains();
  void arrange_trouble();
  void blow();
  void step();
  void crash_coordinator();
  void watch();
  void calm_down();
  [[nodiscard]] bool is_over() const;
  void check_progress();
  [[nodiscard]] bool could_run(const coordinator::JobState& job) const;
  [[nodiscard]] std::string stuck_reason(const coordinator::JobState& job) const;
  void check_ends() const;

  const Scenario scenario_;
  Ground ground_;
  Checks checks_;
  CoordinatorModel coordinator_;
  Client client_;
  std::vector<std::unique_ptr<Machine>> machines_;
  bool is_calm_ = false;
  bool will_start_ = false;
  std::uint64_t steps_ = 0;
  std::uint64_t steps_in_ms_ = 0;
  std::uint64_t spoilt_ = 0;
  std::uint64_t crashes_ = 0;
  std::map<std::string, std::uint64_t> stuck_since_ms_;  // jobs
};

[[nodiscard]] Outcome run_seed(std::uint64_t seed, bool is_traced);

}  // namespace weft::simulation
