#include "cli/local_run.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "coordinator/plan.h"
#include "coordinator/versions/commit.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/resource_use.h"
#include "worker/baker.h"

namespace weft::cli {

namespace {

constexpr std::chrono::milliseconds kReportPeriod{100};

// A stage that is being computed.
struct RunningStage {
  coordinator::Stage plan;
  std::unique_ptr<worker::Baker> baker;
  std::vector<core::Digest> names;    // by shard
  std::vector<core::Digest> results;  // by shard
  std::vector<std::uint64_t> todo;    // shards that are not in the cache
  std::size_t next = 0;               // in todo: the first shard nobody has begun
  std::uint64_t done = 0;
  std::uint64_t cached = 0;
  core::Stopwatch since_start;
  double seconds = 0;  // of a finished stage
  double cpu_seconds = 0;

  [[nodiscard]] bool is_finished() const { return done == plan.shard_count; }
};

// Threads take shards from whichever stage has some, the calling thread plans, so that a stage of
// one shard leaves the other threads to the next stage.
class LocalRun {
 public:
  LocalRun(const v1::FabricDescription& description, unsigned threads, ResultCache& cache,
           const LocalRunHooks& hooks)
      : description_(description), threads_(threads), cache_(cache), hooks_(hooks) {}

  void run();
  [[nodiscard]] std::vector<coordinator::StageResults> results() const;
  [[nodiscard]] std::vector<StageProgress> progress() const;
  [[nodiscard]] std::string read(const core::Digest& digest) const { return cache_.read(digest); }
  [[nodiscard]] double idle_seconds() const { return idle_seconds_; }  // after run()

 private:
  struct Claim {
    RunningStage* stage = nullptr;
    std::uint64_t shard = 0;
  };

  void plan_what_is_ready();
  [[nodiscard]] std::unique_ptr<RunningStage> start(coordinator::Stage plan) const;
  [[nodiscard]] bool is_known(coordinator::StageName name) const;
  void throw_if_stopped() const;
  void follow();
  void work();
  [[nodiscard]] std::optional<Claim> claim();
  void bake(const Claim& claim);
  void stop(std::exception_ptr cause);

  const v1::FabricDescription& description_;
  const unsigned threads_;
  ResultCache& cache_;
  const LocalRunHooks& hooks_;
  const core::Digest fingerprint_ = worker::numerics_fingerprint();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::unique_ptr<RunningStage>> stages_;  // in the order they were planned
  std::size_t finished_count_ = 0;
  bool is_over_ = false;  // nothing more is to be begun
  double idle_seconds_ = 0;
  std::exception_ptr failure_;
  std::atomic<bool> should_stop_{false};
};

bool LocalRun::is_known(coordinator::StageName name) const {
  return std::any_of(stages_.begin(), stages_.end(),
                     [&](const auto& stage) { return stage->plan.name == name; });
}

void LocalRun::throw_if_stopped() const {
  if (hooks_.should_stop()) {
    throw core::Error(core::Code::kCancelled, "stopped before it was finished");
  }
}

std::unique_ptr<RunningStage> LocalRun::start(coordinator::Stage plan) const {
  auto stage = std::make_unique<RunningStage>();
  const double cpu_before = core::thread_cpu_seconds();
  stage->names.reserve(plan.shard_count);
  stage->results.resize(plan.shard_count);
  for (std::uint64_t shard = 0; shard < plan.shard_count; ++shard) {
    throw_if_stopped();
    stage->names.push_back(coordinator::shard_digest(plan, shard, fingerprint_));
    if (const auto result = cache_.find(stage->names.back())) {
      stage->results[shard] = *result;
      ++stage->cached;
    } else {
      stage->todo.push_back(shard);
    }
  }
  stage->done = stage->cached;
  if (!stage->todo.empty()) {
    worker::BakerContext context{plan.spec, plan.shard_count, {}, threads_};
    for (const core::Digest& input : plan.inputs) {
      context.inputs.push_back(cache_.read(input));
    }
    stage->baker = worker::make_baker(std::move(context));
  }
  stage->plan = std::move(plan);
  stage->cpu_seconds = core::thread_cpu_seconds() - cpu_before;
  return stage;
}

void LocalRun::plan_what_is_ready() {
  // A stage whose shards are all in the cache is finished at once and may make others ready.
  bool is_changed = true;
  while (is_changed) {
    is_changed = false;
    const auto reader = [this](const core::Digest& digest) { return read(digest); };
    for (coordinator::Stage& plan : coordinator::plan(description_, results(), reader)) {
      if (is_known(plan.name)) {
        continue;
      }
      std::unique_ptr<RunningStage> stage = start(std::move(plan));
      is_changed = is_changed || stage->is_finished();
      const std::lock_guard lock(mutex_);
      finished_count_ += stage->is_finished() ? 1 : 0;
      stages_.push_back(std::move(stage));
      changed_.notify_all();
    }
  }
}

std::vector<coordinator::StageResults> LocalRun::results() const {
  const std::lock_guard lock(mutex_);
  std::vector<coordinator::StageResults> results;
  for (const coordinator::StageName name : coordinator::all_stages()) {
    for (const auto& stage : stages_) {
      if (stage->plan.name == name && stage->is_finished()) {
        results.push_back({name, stage->results});
      }
    }
  }
  return results;
}

std::vector<StageProgress> LocalRun::progress() const {
  const std::lock_guard lock(mutex_);
  std::vector<StageProgress> progress;
  for (const coordinator::StageName name : coordinator::all_stages()) {
    progress.push_back({coordinator::to_string(name), 0, 0, 0, 0});
    for (const auto& stage : stages_) {
      if (stage->plan.name == name) {
        progress.back().done = stage->done;
        progress.back().total = stage->plan.shard_count;
        progress.back().cached = stage->cached;
        progress.back().seconds =
            stage->is_finished() ? stage->seconds : stage->since_start.seconds();
        progress.back().cpu_seconds = stage->cpu_seconds;
      }
    }
  }
  return progress;
}

std::optional<LocalRun::Claim> LocalRun::claim() {
  std::unique_lock lock(mutex_);
  while (!is_over_) {
    for (const auto& stage : stages_) {
      if (stage->next < stage->todo.size()) {
        return Claim{stage.get(), stage->todo[stage->next++]};
      }
    }
    const core::Stopwatch since_idle;
    changed_.wait(lock);
    idle_seconds_ += since_idle.seconds();
  }
  return std::nullopt;
}

void LocalRun::bake(const Claim& claim) {
  RunningStage& stage = *claim.stage;
  const double cpu_before = core::thread_cpu_seconds();
  const core::Stopwatch since_start;
  const std::string shard_input = stage.plan.shard_inputs.empty()
                                      ? std::string()
                                      : cache_.read(stage.plan.shard_inputs[claim.shard]);
  const std::string result =
      stage.baker->bake(claim.shard, shard_input, [this] { return should_stop_.load(); });
  const core::Digest digest = cache_.put(stage.names[claim.shard], result);
  std::unique_ptr<worker::Baker> spent;  // released outside the lock: a scene is large
  const std::lock_guard lock(mutex_);
  stage.results[claim.shard] = digest;
  const double cpu_seconds = core::thread_cpu_seconds() - cpu_before;
  stage.cpu_seconds += cpu_seconds;
  // A shard that took more CPU time than time had help of threads that are waiting for shards.
  idle_seconds_ -= std::max(0.0, cpu_seconds - since_start.seconds());
  ++stage.done;
  if (stage.is_finished()) {
    stage.seconds = stage.since_start.seconds();
    spent = std::move(stage.baker);
    ++finished_count_;
    changed_.notify_all();
  }
}

void LocalRun::work() {
  try {
    while (const std::optional<Claim> next = claim()) {
      try {
        bake(*next);
      } catch (const core::Error& error) {
        throw core::Error(error.code(),
                          std::string("stage ") + coordinator::to_string(next->stage->plan.name) +
                              ", shard " + std::to_string(next->shard) + ": " + error.what());
      }
    }
  } catch (...) {
    stop(std::current_exception());
  }
}

void LocalRun::stop(std::exception_ptr cause) {
  should_stop_.store(true);
  const std::lock_guard lock(mutex_);
  if (cause && !failure_) {
    failure_ = std::move(cause);
  }
  is_over_ = true;
  changed_.notify_all();
}

void LocalRun::follow() {
  std::size_t planned_for = 0;
  plan_what_is_ready();
  std::unique_lock lock(mutex_);
  while (!is_over_ && (finished_count_ < stages_.size() || finished_count_ != planned_for)) {
    changed_.wait_for(lock, kReportPeriod,
                      [&] { return is_over_ || finished_count_ != planned_for; });
    const bool has_news = finished_count_ != planned_for;
    planned_for = finished_count_;
    lock.unlock();
    hooks_.report(progress());
    throw_if_stopped();
    if (has_news) {
      plan_what_is_ready();
    }
    lock.lock();
  }
}

void LocalRun::run() {
  {
    std::vector<std::jthread> workers;
    for (unsigned i = 0; i < threads_; ++i) {
      workers.emplace_back([this] { work(); });
    }
    try {
      follow();
      stop(nullptr);
    } catch (...) {
      stop(std::current_exception());
    }
  }
  if (failure_) {
    std::rethrow_exception(failure_);
  }
}

}  // namespace

LocalRunResult run_locally(const v1::FabricDescription& description, unsigned threads,
                           ResultCache& cache, const std::filesystem::path& output,
                           const LocalRunHooks& hooks) {
  LocalRun run(description, threads, cache, hooks);
  run.run();
  hooks.report(run.progress());
  const auto reader = [&](const core::Digest& digest) { return run.read(digest); };
  const core::Stopwatch since_merge;
  const core::Digest digest = coordinator::commit(description, run.results(), reader, output);
  return {digest, run.progress(), since_merge.seconds(), run.idle_seconds()};
}

}  // namespace weft::cli
