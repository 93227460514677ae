#pragma once

#include <cstdint>
#include <functional>

#include "core/random.h"
#include "tests/simulation/timeline.h"

// What all parts of a simulated cluster stand on: time, chance, the weather, the trace.

namespace weft::simulation {

// How often what goes wrong; all zero in a calm cluster. Chances are per message, write, shard.
struct Weather {
  double lost_messages = 0;
  double doubled_messages = 0;
  double late_messages = 0;  // by up to 40 s
  double journal_failures = 0;
  double slow_syncs = 0;
  double blob_failures = 0;      // the coordinator's disk takes no blob
  double forgetful_workers = 0;  // a completion is not on the worker's disk when it dies
  double short_resources = 0;
  double passing_failures = 0;  // of a shard, that another try does not meet
  double hung_shards = 0;
  double crashes = 0;  // of the coordinator, per step
  double kills = 0;    // of some worker, per step
};

class Ground {
 public:
  Ground(std::uint64_t seed, bool is_traced) : random(seed, 1), trace(is_traced) {}

  [[nodiscard]] bool happens(double chance) { return chance > 0 && random.uniform() < chance; }
  // `low` ... `high`, both included.
  [[nodiscard]] std::uint64_t between(std::uint64_t low, std::uint64_t high) {
    return low + random.below(static_cast<std::uint32_t>(high - low + 1));
  }

  template <class... Args>
  void say(fmt::format_string<Args...> format, Args&&... args) const {
    trace.line(timeline, format, std::forward<Args>(args)...);
  }

  // Carries a message: it arrives once, twice or not at all, now or later.
  void carry(const std::function<void()>& arrive) {
    const int copies = happens(weather.doubled_messages) ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      if (!happens(weather.lost_messages)) {
        const std::uint64_t longest_ms = happens(weather.late_messages) ? 40'000 : 10;
        timeline.after(between(0, longest_ms), arrive);
      }
    }
  }

  core::Random random;
  Trace trace;
  Timeline timeline;
  Weather weather;
};

}  // namespace weft::simulation
