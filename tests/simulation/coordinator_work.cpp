#include <algorithm>
#include <utility>

#include "coordinator/scheduler/messages.h"
#include "core/check.h"
#include "tests/simulation/coordinator_model.h"

// Planning and committing: each begins, takes a while, and ends, if nothing came in between.

namespace weft::simulation {

using namespace coordinator;

namespace {

// A result that the journal knows is not on the disk.
struct BlobLost {
  core::Digest digest;
};

template <class Desk>
bool has_task(const Desk& desk, const JobState& job) {
  const auto is_its = [&](const auto& task) {
    return task.job == job.id && task.generation == job.generation;
  };
  return (desk.under_way && is_its(*desk.under_way)) ||
         std::any_of(desk.waiting.begin(), desk.waiting.end(), is_its);
}

}  // namespace

bool CoordinatorModel::is_being_planned(const JobState& job) const {
  return has_task(process_->plans, job);
}

bool CoordinatorModel::is_being_committed(const JobState& job) const {
  return has_task(process_->commits, job);
}

std::string CoordinatorModel::read_or_lose(const core::Digest& digest) {
  std::optional<std::string> bytes = blobs_.get(digest);
  if (!bytes) {
    throw BlobLost{digest};
  }
  return *std::move(bytes);
}

void CoordinatorModel::result_lost(const core::Digest& result) {
  ground_.say("result {} is lost", result.hex().substr(0, 8));
  apply(ResultLostEvent{result}, nullptr, {ForgetRow{result}});
}

void CoordinatorModel::next_plan() {
  auto& desk = process_->plans;
  while (!desk.under_way && !desk.waiting.empty()) {
    const PlanAction task = desk.waiting.front();
    desk.waiting.pop_front();
    const JobState* const job = process_->queue.job(task.job);
    if (job == nullptr || job->generation != task.generation) {
      continue;
    }
    desk.under_way = task;
    later(ground_.between(1, 100), [this, finished = process_->queue.finished_stages(*job)] {
      finish_plan(finished);
      if (process_) {
        next_plan();
      }
    });
  }
}

void CoordinatorModel::finish_plan(const std::vector<StageResults>& finished) {
  const PlanAction task = *std::exchange(process_->plans.under_way, std::nullopt);
  const auto file = process_->files.find(task.job);
  if (file == process_->files.end()) {
    return;  // it has ended meanwhile
  }
  std::vector<FakeStage> stages;
  try {
    stages = plan(file->second.fabric, finished,
                  [this](const core::Digest& digest) { return read_or_lose(digest); });
  } catch (const BlobLost& lost) {
    result_lost(lost.digest);
    return;
  }
  if (file->second.generation != task.generation) {
    file->second.generation = task.generation;
    file->second.stages.clear();
  }
  PlannedEvent event{task.job, task.generation, {}};
  for (FakeStage& stage : stages) {
    if (!file->second.stages.contains(stage.name)) {
      event.stages.push_back(with_known(task.job, stage, task.fingerprint));
      ground_.say("{} {} is planned: {} shards, {} known", task.job, to_string(stage.name),
                  stage.shard_count, event.stages.back().known.size());
      file->second.stages.emplace(stage.name, std::move(stage));
    }
  }
  apply(event, nullptr);
}

PlannedStage CoordinatorModel::with_known(const std::string& job, const FakeStage& stage,
                                          const core::Digest& fingerprint) {
  const Tables& tables = journal_.tables();
  PlannedStage planned;
  planned.name = stage.name;
  for (std::uint64_t shard = 0; shard < stage.shard_count; ++shard) {
    planned.digests.push_back(work_of(stage, shard, fingerprint));
    const auto known = tables.results.find(planned.digests.back());
    if (known != tables.results.end() && blobs_.has(known->second.result)) {
      planned.known.push_back(
          {shard, known->second.result, known->second.worker, known->second.is_audited});
    } else if (known != tables.results.end()) {
      checks_.unavailable(planned.digests.back());
    }
  }
  for (const FailureRecord& failure : tables.failures) {
    if (failure.job == job && failure.stage == stage.name) {
      planned.failures.push_back({failure.kind, failure.shard, failure.worker, failure.message});
    }
  }
  for (const auto& [id, loss] : tables.lost) {
    const auto& [attempt, at_ms] = loss;
    if (attempt.job == job && attempt.stage == stage.name) {
      planned.losses.push_back({attempt.worker, attempt.worker_name, attempt.first_shard,
                                attempt.shards,
                                coordinator::Time(std::chrono::milliseconds(at_ms))});
    }
  }
  for (const auto& [id, attempt] : tables.attempts) {
    const bool is_of_earlier_epoch = id >> 32 < process_->epoch;
    if (attempt.job == job && attempt.stage == stage.name && is_of_earlier_epoch) {
      planned.attempts.push_back({id, attempt.first_shard, attempt.shards, attempt.worker,
                                  attempt.worker_name, attempt.purpose});
    }
  }
  const FakeFabric& fabric = process_->files.at(job).fabric;
  planned.memory_bytes = stage.name == StageName::kTransfer ? fabric.transfer_bytes : 0;
  if (!stage.inputs.empty()) {
    planned.scene = stage.inputs.front();
  }
  return planned;
}

void CoordinatorModel::next_commit() {
  auto& desk = process_->commits;
  while (!desk.under_way && !desk.waiting.empty()) {
    const CommitAction task = desk.waiting.front();
    desk.waiting.pop_front();
    const JobState* const job = process_->queue.job(task.job);
    if (job == nullptr || job->generation != task.generation) {
      continue;
    }
    desk.under_way = task;
    later(ground_.between(10, 2'000), [this, finished = process_->queue.finished_stages(*job)] {
      finish_commit(finished);
      if (process_) {
        next_commit();
      }
    });
  }
}

void CoordinatorModel::finish_commit(const std::vector<StageResults>& finished) {
  const CommitAction task = *std::exchange(process_->commits.under_way, std::nullopt);
  const auto file = process_->files.find(task.job);
  if (file == process_->files.end()) {
    return;
  }
  core::Digest database;
  try {
    database = fold(file->second.fabric, finished,
                    [this](const core::Digest& digest) { return read_or_lose(digest); });
  } catch (const BlobLost& lost) {
    result_lost(lost.digest);
    return;
  }
  const JobState* const job = process_->queue.job(task.job);
  const bool is_wanted = job->generation == task.generation && job->phase == JobPhase::kCommitting;
  if (!is_wanted) {
    return;
  }
  const std::string& fabric = file->second.fabric.name;
  const auto& versions = journal_.tables().versions;
  const auto latest = std::find_if(versions.rbegin(), versions.rend(),
                                   [&](const auto& version) { return version.first == fabric; });
  if (latest == versions.rend() || latest->second != database) {
    journal_.add_version(fabric, database);
    ground_.say("{} publishes {} {}", task.job, fabric, database.hex().substr(0, 8));
  }
  if (ground_.happens(ground_.weather.journal_failures)) {
    crash();  // published, and nobody was told
    return;
  }
  file->second.database = database;
  apply(CommittedEvent{task.job, task.generation}, nullptr);
}

}  // namespace weft::simulation
