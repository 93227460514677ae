#include <exception>

#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/error.h"

// Results beyond the job that made them: what must not be collected, and versions that are made
// from them a second time.

namespace weft::coordinator {

std::set<core::Digest> Scheduler::results_in_use() {
  const std::lock_guard lock(mutex_);
  check_running();
  std::set<core::Digest> results;
  for (const JobState* const job : queue_.jobs()) {
    if (job->has_ended()) {
      continue;
    }
    if (job->fingerprint && (job->stages.empty() || job->planning)) {
      throw core::Error(
          core::Code::kFailedPrecondition,
          "job " + job->id + " is not planned yet: nobody knows which results it has");
    }
    for (const StageState& stage : job->stages) {
      for (std::size_t shard = 0; shard < stage.shards.size(); ++shard) {
        if (stage.shards[shard] == ShardState::kDone) {
          results.insert(stage.results[shard]);
        }
      }
    }
  }
  return results;
}

void Scheduler::forget_gone(const std::vector<core::Digest>& results) {
  const std::lock_guard lock(mutex_);
  check_running();
  for (const core::Digest& result : results) {
    if (!blobs_.has(result)) {
      (void)journal_.forget_result(result);
    }
  }
}

// Takes no lock of the scheduler: whoever asks may be inside one.
std::optional<std::filesystem::path> Scheduler::remake(const VersionRecord& version) {
  const std::optional<JobOrigin> origin = journal_.catalogue().job_origin(version.job);
  v1::FabricDescription description;
  if (!origin || !description.ParseFromString(origin->description)) {
    return std::nullopt;
  }
  const auto read = [this](const core::Digest& digest) { return read_blob(digest); };
  const std::filesystem::path path =
      options_.state_folder / "committing" / ("remade-" + version.file);
  try {
    std::vector<StageResults> finished;
    for (std::vector<Stage> stages = plan(description, finished, read); !stages.empty();
         stages = plan(description, finished, read)) {
      for (const Stage& stage : stages) {
        StageResults results{stage.name, {}};
        for (const std::optional<KeptResult>& kept :
             journal_.results_of(shard_digests(stage, origin->fingerprint))) {
          if (!kept || !blobs_.use(kept->result)) {
            return std::nullopt;
          }
          results.shards.push_back(kept->result);
        }
        finished.push_back(std::move(results));
      }
    }
    if (options_.commit(description, finished, read, path) == version.content_digest) {
      return path;
    }
    spdlog::error("version={}@{} event=remade_otherwise", version.fabric, version.number);
  } catch (const std::exception& error) {
    spdlog::warn("version={}@{} event=not_remade message=\"{}\"", version.fabric, version.number,
                 error.what());
  }
  return std::nullopt;
}

}  // namespace weft::coordinator
