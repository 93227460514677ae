#pragma once

#include <cstdint>
#include <map>

#include "coordinator/queue/queue.h"

namespace weft::coordinator {

// The cluster in figures, for those who watch and scale it.
struct Census {
  struct Shards {  // of unfinished jobs
    std::uint64_t waiting = 0;
    std::uint64_t running = 0;
    std::uint64_t done = 0;
    std::uint64_t quarantined = 0;
    std::uint64_t awaiting_audit = 0;  // done, and to be confirmed by a second worker
  };
  std::map<StageName, Shards> shards;  // of all stages
  // Of a paused job nothing counts as work.
  std::uint64_t runnable_shards = 0;  // waiting, awaiting audit and running: as many threads have
                                      // something to do at once
  double work_seconds = 0;  // that the waiting ones take on one thread, where a stage has measured

  std::uint64_t jobs_queued = 0;
  std::uint64_t jobs_running = 0;
  std::uint64_t jobs_committing = 0;
  std::uint64_t jobs_paused = 0;  // of any of these

  std::uint64_t workers_live = 0;  // and what follows is of these, but the last
  std::uint64_t workers_idle = 0;  // they run nothing
  std::uint64_t workers_drained = 0;
  std::uint64_t workers_blocked = 0;  // for some kind of task
  std::uint64_t threads = 0;
  std::uint64_t workers_lost = 0;
};

[[nodiscard]] Census census_of(const Queue& queue, Time now);

}  // namespace weft::coordinator
