#pragma once

#include <cstdint>
#include <span>

#include "proto/weft/v1/cluster.pb.h"

namespace weft::cli {

struct ScaleLimits {
  std::uint32_t fewest = 0;
  std::uint32_t most = 1;
  std::uint32_t threads = 1;    // of each worker
  double seconds_of_work = 60;  // for which a worker is worth starting
};

// How many workers the queue could keep busy, within the limits: `now` are those that there are,
// waiting ones included. A stage whose rate is known wants one thread for each seconds_of_work
// that all its threads together need; one whose rate is not known wants a thread for each shard,
// but no more than twice the workers of now, so that it becomes known. A job of which nothing
// has run yet wants one thread, paused jobs want none.
[[nodiscard]] std::uint32_t wanted_workers(std::span<const v1::Job> unfinished,
                                           std::span<const v1::Worker> workers, std::uint32_t now,
                                           const ScaleLimits& limits);

}  // namespace weft::cli
