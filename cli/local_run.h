#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "cli/progress.h"
#include "cli/result_cache.h"
#include "core/digest.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::cli {

struct LocalRunHooks {
  // Called a few times a second, from the thread that called run_locally.
  std::function<void(const std::vector<StageProgress>&)> report;
  // Asked a few times a second; work stops soon after it says yes.
  std::function<bool()> should_stop;
};

struct LocalRunResult {
  core::Digest content_digest;
  std::vector<StageProgress> stages;
  double merge_seconds = 0;  // folding the results into the database
  double idle_seconds = 0;   // thread time in which a thread had no shard, before the merge
};

// The whole precomputation of a canonical description in this process: what the cluster's planner
// plans, its bakers bake and its commit folds, on `threads` threads. Every finished shard is in
// `cache` at once, so a run that was stopped goes on where it was. Writes the database to `output`.
// Throws core::Error(kCancelled) when `should_stop` said so, and what planner, bakers and commit
// throw.
[[nodiscard]] LocalRunResult run_locally(const v1::FabricDescription& description, unsigned threads,
                                         ResultCache& cache, const std::filesystem::path& output,
                                         const LocalRunHooks& hooks);

}  // namespace weft::cli
