#include <algorithm>
#include <set>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/error.h"

// What the scheduler does in threads of its own: planning and committing.

namespace weft::coordinator {

namespace {

// A blob that the journal says is there is not, or is damaged.
class BlobLost : public core::Error {
 public:
  explicit BlobLost(const core::Digest& digest)
      : core::Error(core::Code::kDataLoss, "the result " + digest.hex() + " is lost"),
        digest_(digest) {}
  [[nodiscard]] const core::Digest& digest() const { return digest_; }

 private:
  core::Digest digest_;
};

// What a disk or a limit of ours keeps from being done, and may be possible later.
bool is_short(const core::Error& error) {
  return error.code() == core::Code::kUnavailable || error.code() == core::Code::kResourceExhausted;
}

constexpr auto kLook = std::chrono::seconds(1);
constexpr std::size_t kLossesConsidered = 1'000;  // attempts of a stage that are looked through
constexpr std::uint32_t kTriesLimit = 20;
constexpr std::chrono::milliseconds kLongestPause{60'000};

}  // namespace

std::string Scheduler::read_blob(const core::Digest& digest) {
  std::optional<std::string> bytes = blobs_.get(digest);
  if (!bytes) {
    throw BlobLost(digest);
  }
  return std::move(*bytes);
}

void Scheduler::result_lost(const core::Digest& result) { report(ResultLostEvent{result}); }

void Scheduler::work_through(std::deque<Task>& tasks) {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const Time now = clock_.now();
    const auto ready = std::find_if(tasks.begin(), tasks.end(),
                                    [&](const Task& task) { return task.not_before <= now; });
    if (ready == tasks.end()) {
      Time::duration pause = kLook;
      for (const Task& task : tasks) {
        pause = std::min<Time::duration>(pause, task.not_before - now);
      }
      tasks_changed_.wait_for(lock, pause);
      continue;
    }
    Task task = std::move(*ready);
    tasks.erase(ready);
    lock.unlock();
    work_on(std::move(task), tasks);
    lock.lock();
    if (&tasks == &to_plan_) {
      recent_ = {};
    }
  }
}

void Scheduler::work_on(Task task, std::deque<Task>& tasks) {
  const bool is_plan = std::holds_alternative<PlanAction>(task.what);
  std::string problem;
  try {
    std::visit([&](const auto& t) { run(t); }, task.what);
    return;
  } catch (const BlobLost& lost) {
    report(ResultLostEvent{lost.digest()});
    return;
  } catch (const core::Error& error) {
    problem = error.what();
    if (is_short(error) && put_off(task, tasks, problem)) {
      return;
    }
  } catch (const std::exception& error) {
    problem = error.what();
  }
  std::visit(
      [&](const auto& t) {
        report(JobFailedEvent{
            t.job, t.generation,
            std::string(is_plan ? "planning: " : "assembling the database: ") + problem});
      },
      task.what);
}

// Our own disk is full or failing, which is no fault of the job: it is tried again for a quarter of
// an hour. Whether it will be.
bool Scheduler::put_off(Task task, std::deque<Task>& tasks, const std::string& problem) {
  if (++task.tries >= kTriesLimit) {
    return false;
  }
  const std::string job = std::visit([](const auto& t) { return t.job; }, task.what);
  const auto pause = std::min<std::chrono::milliseconds>(
      options_.put_off * (1U << std::min(task.tries - 1, 10U)), kLongestPause);
  spdlog::warn("job={} event=put_off tries={} retry_ms={} message=\"{}\"", job, task.tries,
               pause.count(), problem);
  const std::lock_guard lock(mutex_);
  task.not_before = clock_.now() + pause;
  const auto file = files_.find(job);
  if (file != files_.end()) {
    file->second.problem = "the coordinator's disk: " + problem;
  }
  tasks.push_back(std::move(task));
  return true;
}

// Tells the queue what a task of ours met. When the journal cannot be written, fatal_ says so and
// the process is about to end.
void Scheduler::report(const Event& event) {
  try {
    const std::lock_guard lock(mutex_);
    check_running();
    const auto* const lost = std::get_if<ResultLostEvent>(&event);
    if (lost != nullptr) {
      if (recent_.is_kept) {
        recent_.lost.insert(lost->result);
      }
      const std::uint64_t shards = journal_.forget_result(lost->result);
      if (shards > 0) {
        spdlog::warn("result={} event=lost shards={}", lost->result.hex(), shards);
      }
    }
    apply(event, nullptr);
  } catch (const core::Error& error) {
    spdlog::error("event=not_recorded message=\"{}\"", error.what());
  }
}

// The stages as the queue knows them, with all that need not be computed. Looks results up without
// mutex_, which may take seconds for a million shards; add_recent then adds what fell in between.
std::vector<PlannedStage> Scheduler::look_up(const std::string& job,
                                             const std::vector<Stage>& stages,
                                             const core::Digest& fingerprint,
                                             std::uint64_t& cached_bytes) {
  std::vector<PlannedStage> planned;
  for (const Stage& stage : stages) {
    PlannedStage& of_stage = planned.emplace_back();
    of_stage.name = stage.name;
    of_stage.digests = shard_digests(stage, fingerprint);
    of_stage.memory_bytes = stage.memory_bytes;
    if (!stage.inputs.empty()) {
      of_stage.scene = stage.inputs.front();
    }
    std::vector<std::optional<KeptResult>> results = journal_.results_of(of_stage.digests);
    for (std::size_t i = 0; i < results.size(); ++i) {
      const std::optional<std::uint64_t> size_bytes =
          results[i] ? blobs_.use(results[i]->result) : std::nullopt;
      if (size_bytes) {
        cached_bytes += *size_bytes;
        of_stage.known.push_back(
            {i, results[i]->result, std::move(results[i]->worker), results[i]->is_audited});
      }
    }
    for (FailureRecord& failure : journal_.failures_of(job, stage.name)) {
      of_stage.failures.push_back(
          {failure.kind, failure.shard, std::move(failure.worker), std::move(failure.message)});
    }
    for (KeptAttempt& attempt : journal_.attempts_of(
             job, kLossesConsidered,
             [&](const AttemptRecord& begun) { return begun.stage == stage.name; })) {
      if (attempt.end && attempt.end->outcome == Outcome::kLost) {
        of_stage.losses.push_back({std::move(attempt.begin.worker),
                                   std::move(attempt.begin.worker_name), attempt.begin.first_shard,
                                   attempt.begin.shards,
                                   Time(std::chrono::milliseconds(attempt.end->ended_at_ms))});
      }
    }
    for (AttemptRecord& attempt : journal_.running_attempts(job, stage.name)) {
      of_stage.attempts.push_back({attempt.attempt, attempt.first_shard, attempt.shards,
                                   std::move(attempt.worker), std::move(attempt.worker_name),
                                   attempt.purpose});
    }
  }
  return planned;
}

void Scheduler::add_recent(PlannedStage& stage) const {
  if (recent_.by_shard.empty() && recent_.lost.empty()) {
    return;
  }
  std::erase_if(stage.known, [&](const KnownResult& known) {
    return recent_.lost.contains(known.result) ||
           recent_.by_shard.contains(stage.digests[known.shard]);
  });
  for (std::uint64_t shard = 0; shard < stage.digests.size(); ++shard) {
    const auto recent = recent_.by_shard.find(stage.digests[shard]);
    if (recent != recent_.by_shard.end() && recent->second &&
        !recent_.lost.contains(recent->second->result)) {
      stage.known.push_back(
          {shard, recent->second->result, recent->second->worker, recent->second->is_audited});
    }
  }
}

void Scheduler::run(const PlanAction& task) {
  std::unique_lock lock(mutex_);
  const JobState* const job = queue_.job(task.job);
  if (job == nullptr || job->generation != task.generation) {
    return;
  }
  const v1::FabricDescription description = files_.at(task.job).description;
  const std::vector<StageResults> finished = queue_.finished_stages(*job);
  std::set<StageName> known;
  if (files_.at(task.job).generation == task.generation) {
    for (const auto& [name, stage] : files_.at(task.job).stages) {
      known.insert(name);
    }
  }
  recent_ = {true, {}, {}};
  lock.unlock();

  std::vector<Stage> stages =
      plan(description, finished, [this](const core::Digest& digest) { return read_blob(digest); });
  std::erase_if(stages, [&](const Stage& stage) { return known.contains(stage.name); });
  std::uint64_t cached_bytes = 0;
  PlannedEvent event{task.job, task.generation,
                     look_up(task.job, stages, task.fingerprint, cached_bytes)};

  lock.lock();
  const auto file = files_.find(task.job);
  if (file == files_.end()) {
    return;  // it has ended meanwhile
  }
  file->second.problem.clear();
  if (file->second.generation != task.generation) {
    file->second.generation = task.generation;
    file->second.stages.clear();
    file->second.cached_bytes = 0;
  }
  for (std::size_t i = 0; i < stages.size(); ++i) {
    PlannedStage& planned = event.stages[i];
    add_recent(planned);
    spdlog::info("job={} stage={} event=planned shards={} cached={} running={}", task.job,
                 to_string(planned.name), planned.digests.size(), planned.known.size(),
                 planned.attempts.size());
    file->second.stages.emplace(planned.name, std::move(stages[i]));
  }
  file->second.cached_bytes += cached_bytes;
  recent_ = {};
  apply(event, nullptr);
}

void Scheduler::run(const CommitAction& task) {
  std::unique_lock lock(mutex_);
  const JobState* job = queue_.job(task.job);
  if (job == nullptr || job->generation != task.generation) {
    return;
  }
  const v1::FabricDescription description = files_.at(task.job).description;
  const std::vector<StageResults> finished = queue_.finished_stages(*job);
  lock.unlock();

  Publication publication;
  publication.fabric = description.name();
  publication.file = options_.state_folder / "committing" / (task.job + ".h5");
  publication.job = task.job;
  publication.content_digest = options_.commit(
      description, finished, [this](const core::Digest& digest) { return read_blob(digest); },
      publication.file);
  for (const StageResults& stage : finished) {
    publication.results.insert(publication.results.end(), stage.shards.begin(), stage.shards.end());
  }
  catalogue_.prepare(publication);

  lock.lock();
  job = queue_.job(task.job);
  const bool is_wanted =
      job != nullptr && job->generation == task.generation && job->phase == JobPhase::kCommitting;
  if (!is_wanted) {  // cancelled meanwhile
    std::filesystem::remove(publication.file);
    return;
  }
  JobFile& file = files_.at(task.job);
  file.problem.clear();
  publication.comment = file.comment;
  publication.user = job->demands.user;
  for (const StageState& stage : job->stages) {
    publication.cached_shards += stage.cached;
    publication.computed_shards += stage.done - stage.cached;
  }
  publication.now_ms = to_ms(clock_.now());
  file.version = catalogue_.publish(publication);
  spdlog::info("job={} event=published version={}@{} digest={} bytes={}", task.job,
               file.version->fabric, file.version->number, file.version->content_digest.hex(),
               file.version->size_bytes);
  apply(CommittedEvent{task.job, task.generation}, nullptr);
}

}  // namespace weft::coordinator
