#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/scheduler.h"
#include "core/error.h"

// What the scheduler does in its own threads, planning and committing, and its talk with workers.

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

v1::AttemptName message_of(const AttemptName& name) {
  v1::AttemptName message;
  message.set_job_id(name.job);
  message.set_attempt(name.attempt);
  return message;
}

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
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return stopping_ || !tasks.empty(); });
    if (stopping_) {
      return;
    }
    const Task task = tasks.front();
    tasks.pop_front();
    lock.unlock();
    try {
      std::visit([&](const auto& t) { run(t); }, task);
    } catch (const BlobLost& lost) {
      report(ResultLostEvent{lost.digest()});
    } catch (const std::exception& error) {
      report(std::visit(
          [&](const auto& t) {
            const bool is_plan = std::is_same_v<std::decay_t<decltype(t)>, PlanAction>;
            return JobFailedEvent{
                t.job, t.generation,
                std::string(is_plan ? "planning: " : "assembling the database: ") + error.what()};
          },
          task));
    }
  }
}

// Tells the queue what a task of ours met. When the journal cannot be written, fatal_ says so and
// the process is about to end.
void Scheduler::report(const Event& event) {
  try {
    const std::lock_guard lock(mutex_);
    check_running();
    const auto* const lost = std::get_if<ResultLostEvent>(&event);
    if (lost != nullptr) {
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

// The stage as the queue knows it, with all that need not be computed. REQUIRES: mutex_ is held, so
// that no result falls between this look-up and the queue.
PlannedStage Scheduler::with_known(const std::string& job, const Stage& stage,
                                   std::vector<core::Digest> digests) {
  PlannedStage planned;
  planned.name = stage.name;
  const std::vector<std::optional<core::Digest>> results = journal_.results_of(digests);
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (results[i] && blobs_.has(*results[i])) {
      planned.known.push_back({i, *results[i], {}, false});
    }
  }
  for (FailureRecord& failure : journal_.failures_of(job, stage.name)) {
    planned.failures.push_back(
        {failure.kind, failure.shard, std::move(failure.worker), std::move(failure.message)});
  }
  planned.digests = std::move(digests);
  return planned;
}

void Scheduler::run(const PlanAction& task) {
  std::unique_lock lock(mutex_);
  const JobState* const job = queue_.job(task.job);
  if (job == nullptr || job->generation != task.generation) {
    return;
  }
  const v1::FabricDescription description = files_.at(task.job).description;
  const std::vector<StageResults> finished = queue_.finished_stages(*job);
  lock.unlock();

  std::vector<Stage> stages =
      plan(description, finished, [this](const core::Digest& digest) { return read_blob(digest); });
  std::vector<std::vector<core::Digest>> digests;
  for (const Stage& stage : stages) {
    std::vector<core::Digest>& works = digests.emplace_back();
    works.reserve(stage.shard_count);
    for (std::uint64_t shard = 0; shard < stage.shard_count; ++shard) {
      works.push_back(shard_digest(stage, shard, task.fingerprint));
    }
  }

  lock.lock();
  const auto file = files_.find(task.job);
  if (file == files_.end()) {
    return;  // it has ended meanwhile
  }
  if (file->second.generation != task.generation) {
    file->second.generation = task.generation;
    file->second.stages.clear();
  }
  PlannedEvent event{task.job, task.generation, {}};
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const StageName name = stages[i].name;
    if (!file->second.stages.contains(name)) {
      event.stages.push_back(with_known(task.job, stages[i], std::move(digests[i])));
      const PlannedStage& planned = event.stages.back();
      spdlog::info("job={} stage={} event=planned shards={} cached={}", task.job, to_string(name),
                   planned.digests.size(), planned.known.size());
      file->second.stages.emplace(name, std::move(stages[i]));
    }
  }
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

  lock.lock();
  job = queue_.job(task.job);
  const bool is_wanted =
      job != nullptr && job->generation == task.generation && job->phase == JobPhase::kCommitting;
  if (!is_wanted) {  // cancelled meanwhile
    std::filesystem::remove(publication.file);
    return;
  }
  JobFile& file = files_.at(task.job);
  publication.comment = file.comment;
  publication.now_ms = to_ms(clock_.now());
  file.version = catalogue_.publish(publication);
  spdlog::info("job={} event=published version={}@{} digest={} bytes={}", task.job,
               file.version->fabric, file.version->number, file.version->content_digest.hex(),
               file.version->size_bytes);
  apply(CommittedEvent{task.job, task.generation}, nullptr);
}

v1::Assignment Scheduler::message(const AssignAction& assign) const {
  const JobFile& file = files_.at(assign.job);
  const Stage& stage = file.stages.at(assign.stage);
  v1::Assignment message;
  message.mutable_name()->set_job_id(assign.job);
  message.mutable_name()->set_attempt(assign.attempt);
  message.set_lease_token(assign.token);
  message.set_lease_ms(assign.lease_ms);
  message.set_fabric(file.description.name());
  message.set_stage(to_string(assign.stage));
  *message.mutable_spec() = stage.spec;
  message.set_shard_count(stage.shard_count);
  for (const core::Digest& input : stage.inputs) {
    message.add_inputs(input.binary());
  }
  message.set_first_shard(assign.first_shard);
  message.set_shards(assign.shards);
  for (std::uint64_t i = 0; i < assign.shards && !stage.shard_inputs.empty(); ++i) {
    message.add_shard_inputs(stage.shard_inputs[assign.first_shard + i].binary());
  }
  return message;
}

v1::SynchronizeResponse Scheduler::message(const Reply& reply) const {
  v1::SynchronizeResponse response;
  for (const AssignAction& assign : reply.assignments) {
    *response.add_assignments() = message(assign);
  }
  for (const AttemptName& name : reply.leases) {
    v1::Lease& lease = *response.add_leases();
    *lease.mutable_name() = message_of(name);
    lease.set_lease_ms(options_.queue.lease_ms);
  }
  for (const AttemptName& name : reply.stop) {
    *response.add_stop() = message_of(name);
  }
  for (const AttemptName& name : reply.acknowledged) {
    *response.add_acknowledged() = message_of(name);
  }
  return response;
}

std::optional<v1::SynchronizeResponse> Scheduler::synchronize(
    ReportEvent report, std::uint64_t sequence, std::chrono::milliseconds wait,
    const std::function<bool()>& is_cancelled) {
  std::unique_lock lock(mutex_);
  check_running();
  const auto known = queue_.workers().find(report.worker);
  if (known != queue_.workers().end() && known->second.fingerprint != report.fingerprint) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "worker " + report.worker +
                          " is known with another numerics fingerprint; start it again, under a "
                          "new worker_id");
  }
  if (known == queue_.workers().end() && !report.leaving) {
    spdlog::info("worker={} name={} threads={} event=joined", report.worker, report.name,
                 report.threads);
  }
  std::uint64_t& newest = sequences_[report.worker];
  if (sequence <= newest) {
    return std::nullopt;
  }
  newest = sequence;
  const Time deadline = clock_.now() + wait;
  for (;;) {
    Reply reply;
    const std::uint64_t wakes = wakes_;
    const Journal::Ticket ticket = apply(report, &reply);
    const bool has_news =
        !reply.assignments.empty() || !reply.stop.empty() || !reply.acknowledged.empty();
    const Time now = clock_.now();
    if (has_news || report.leaving || now >= deadline) {
      v1::SynchronizeResponse response = message(reply);
      lock.unlock();
      journal_.wait(ticket);
      return response;
    }
    // Back-offs and retries become due without an event, so look again now and then.
    changed_.wait_for(lock, std::min(std::chrono::milliseconds(1000), deadline - now), [&] {
      return stopping_ || wakes_ != wakes || sequences_[report.worker] != sequence;
    });
    check_running();
    if (sequences_[report.worker] != sequence || is_cancelled()) {
      return std::nullopt;
    }
  }
}

}  // namespace weft::coordinator
