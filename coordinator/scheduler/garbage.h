#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "coordinator/scheduler/scheduler.h"

namespace weft::coordinator {

struct GarbageOrder {
  bool is_dry_run = false;
  bool empties_trash = false;
  std::int64_t now_ms = 0;
  std::int64_t grace_ms = 0;             // nothing that was used since is touched
  std::int64_t keep_unpublished_ms = 0;  // results of no version are kept so long
};

struct GarbageReport {
  std::uint64_t kept = 0;  // blobs: results, and pieces of versions
  std::uint64_t kept_bytes = 0;
  std::uint64_t removed = 0;  // to the trash
  std::uint64_t removed_bytes = 0;
  std::uint64_t emptied = 0;  // out of the trash, for good
  std::uint64_t emptied_bytes = 0;
  std::vector<std::string> examples;  // some of what goes, with the reason
};

// Moves to the trash what nothing refers to: pieces of no version, and results that no version was
// made from, that no unfinished job has, and that nobody has used for long. Versions themselves are
// never removed. Jobs may run, fetch, upload and publish meanwhile: whoever relies on a blob marks
// it as used first, and what was used within the grace period stays. Every step is one rename or
// one unlink of a file that nothing needs, so the process may die anywhere; what is moved comes
// back by itself when it is used. Throws core::Error(kUnavailable).
GarbageReport collect_garbage(Scheduler& scheduler, const GarbageOrder& order);

}  // namespace weft::coordinator
