#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "coordinator/queue/events.h"

namespace weft::coordinator {

// Workers that were lost lately and what they held: whether a machine dies of one task or of
// whatever it does.
class Deaths {
 public:
  struct Held {
    std::string job;
    StageName stage = StageName::kGeometry;
    std::uint64_t first_shard = 0;
    std::uint64_t shards = 0;

    [[nodiscard]] bool contains(std::uint64_t shard) const {
      return shard >= first_shard && shard - first_shard < shards;
    }
  };

  // A worker, by name and id, was lost and held this among others.
  void add(const std::string& name, const std::string& worker, Time at, Held held);
  // It had only been cut off.
  void take_back(const std::string& name, const std::string& worker);
  void forget_before(Time time);
  void shift(std::chrono::milliseconds by);

  // How many workers of that name were lost that held nothing of which `is_concerned` is true.
  [[nodiscard]] std::size_t elsewhere(const std::string& name,
                                      const std::function<bool(const Held&)>& is_concerned) const;

 private:
  struct Death {
    std::string worker;
    Time at{};
    std::vector<Held> held;
  };

  std::map<std::string, std::vector<Death>> by_name_;
};

}  // namespace weft::coordinator
