#include "tests/simulation/coordinator_model.h"

#include <algorithm>
#include <utility>

#include "coordinator/journal/records_of.h"
#include "core/check.h"

namespace weft::simulation {

using namespace coordinator;

namespace {

constexpr std::uint64_t kTickMs = 1000;
constexpr Time kBeginning{std::chrono::hours(24 * 365 * 50)};

// What the scheduler would have recorded.
void add_records(const Actions& actions, std::vector<Row>& rows) {
  for (const Record& record : records_of(actions)) {
    std::visit(
        [&](const auto& kind) {
          if constexpr (std::is_constructible_v<Row, decltype(kind)>) {
            rows.emplace_back(kind);
          } else {
            throw Violation("the model's journal does not know a kind of record");
          }
        },
        record);
  }
}

End end_of(JobPhase phase) {
  switch (phase) {
    case JobPhase::kSucceeded:
      return End::kSucceeded;
    case JobPhase::kFailed:
      return End::kFailed;
    case JobPhase::kCancelled:
      return End::kCancelled;
    default:
      return End::kNone;
  }
}

}  // namespace

Time CoordinatorModel::now() const {
  return kBeginning + std::chrono::milliseconds(
                          static_cast<std::int64_t>(ground_.timeline.now_ms()) + clock_offset_ms_);
}

const Queue* CoordinatorModel::queue() const { return process_ ? &process_->queue : nullptr; }

// Does something later, unless the process has died by then.
void CoordinatorModel::later(std::uint64_t delay_ms, Done action) {
  ground_.timeline.after(delay_ms, [this, life = life_, action = std::move(action)] {
    if (life == life_ && process_) {
      action();
    }
  });
}

void CoordinatorModel::crash() {
  if (!process_) {
    return;
  }
  const bool keeps = ground_.happens(0.5);
  ground_.say("coordinator dies; what it was writing is {}", keeps ? "there" : "lost");
  ++life_;
  process_.reset();
  journal_.crash(keeps);
  checks_.coordinator_died();
}

void CoordinatorModel::start() {
  CHECK(!process_);
  ++life_;
  process_ = std::make_unique<Process>(settings_, journal_.count_start());
  ground_.say("coordinator starts, epoch {}", process_->epoch);
  load();
  later(kTickMs, [this] { tick(); });
}

// As Scheduler::load.
void CoordinatorModel::load() {
  const Tables& tables = journal_.tables();
  for (const std::string& name : tables.drained) {
    apply(DrainEvent{name, true}, nullptr);
  }
  for (const auto& [block, is_liar] : tables.blocks) {
    apply(BlockEvent{block.first, block.second, true, is_liar}, nullptr);
  }
  std::vector<JobRow> unfinished;
  for (const auto& [id, job] : tables.jobs) {
    if (job.end == End::kNone) {
      unfinished.push_back(job);
    }
  }
  std::sort(unfinished.begin(), unfinished.end(),
            [](const JobRow& a, const JobRow& b) { return a.order < b.order; });
  for (const JobRow& job : unfinished) {
    process_->files[job.id].fabric = job.fabric;
    apply(SubmitEvent{job.id, job.fabric.name, job.fingerprint, job.submitted_at, job.demands,
                      job.is_paused, tables.mismatches_of(job.id)},
          nullptr);
  }
  checks_.loaded(process_->queue, tables);
}

void CoordinatorModel::tick() {
  apply(TickEvent{}, nullptr);
  std::erase_if(process_->sequences, [&](const auto& entry) {
    return !process_->queue.workers().contains(entry.first);
  });
  later(kTickMs, [this] { tick(); });
}

// What people who replay a seed want to know.
void CoordinatorModel::tell(const Actions& actions) const {
  for (const MismatchRecord& mismatch : actions.mismatches) {
    ground_.say("{} {} shard {}: {} and {} differ; the liar is '{}'", mismatch.job,
                to_string(mismatch.stage), mismatch.shard, mismatch.worker, mismatch.other_worker,
                mismatch.liar);
  }
  for (const ResultDropRecord& drop : actions.results_dropped) {
    ground_.say("the result of work {} is dropped", drop.shard.hex().substr(0, 8));
  }
  for (const BlockRecord& block : actions.blocks) {
    ground_.say("{} is {} for {}", block.worker, block.is_blocked ? "blocked" : "unblocked",
                to_string(block.stage));
  }
}

std::uint64_t CoordinatorModel::apply(const Event& event, Reply* reply, std::vector<Row> rows) {
  Process& process = *process_;
  checks_.before(process.queue, event, now());
  Actions actions = process.queue.apply(event, now());
  checks_.after(process.queue, event, actions, now());
  tell(actions);
  add_records(actions, rows);
  for (const std::string& id : actions.ended) {
    end_job(id, rows);
  }
  process.plans.waiting.insert(process.plans.waiting.end(), actions.plan.begin(),
                               actions.plan.end());
  process.commits.waiting.insert(process.commits.waiting.end(), actions.commit.begin(),
                                 actions.commit.end());
  if (reply != nullptr) {
    *reply = std::move(actions.reply);
  }
  const std::uint64_t ticket = journal_.append(std::move(rows));
  sync_when_idle();
  next_plan();
  next_commit();
  if (actions.wake && !process.will_look) {
    process.will_look = true;
    later(0, [this] { look_at_all(); });
  }
  return ticket;
}

void CoordinatorModel::end_job(const std::string& id, std::vector<Row>& rows) {
  const JobState& job = *process_->queue.job(id);
  JobEndRow row{id, end_of(job.phase), job.error, process_->files.at(id).database};
  ground_.say("{} ends: {} {}", id, static_cast<int>(row.end), row.error);
  rows.emplace_back(std::move(row));
  process_->files.erase(id);
  process_->queue.forget_job(id);
}

// ---- the journal's thread

void CoordinatorModel::when_durable(std::uint64_t ticket, Done done) {
  if (ticket <= journal_.durable_ticket()) {
    done();
  } else {
    process_->waiting.emplace(ticket, std::move(done));
  }
}

void CoordinatorModel::sync_when_idle() {
  if (!journal_.is_syncing() && journal_.has_unsynced()) {
    journal_.begin_sync();
    const bool is_slow = ground_.happens(ground_.weather.slow_syncs);
    later(ground_.between(1, is_slow ? 2'000 : 10), [this] { finish_sync(); });
  }
}

void CoordinatorModel::finish_sync() {
  if (ground_.happens(ground_.weather.journal_failures)) {
    ground_.say("the journal cannot be written");
    crash();  // its memory is ahead of its disk
    return;
  }
  journal_.end_sync();
  const auto end = process_->waiting.upper_bound(journal_.durable_ticket());
  std::vector<Done> ready;
  for (auto it = process_->waiting.begin(); it != end; ++it) {
    ready.push_back(std::move(it->second));
  }
  process_->waiting.erase(process_->waiting.begin(), end);
  for (const Done& done : ready) {
    done();
  }
  sync_when_idle();
}

// ---- orders

void CoordinatorModel::submit(const JobRow& job, Done done) {
  if (journal_.tables().jobs.contains(job.id)) {  // the same request again
    when_durable(journal_.append({}), std::move(done));
    return;
  }
  JobRow row = job;
  row.submitted_at = now();
  row.order = journal_.tables().jobs.size();
  process_->files[job.id].fabric = job.fabric;
  ground_.say("{} is submitted: {}", job.id, job.fabric.name);
  const SubmitEvent event{
      job.id, job.fabric.name, std::nullopt, row.submitted_at, job.demands, job.is_paused, {}};
  when_durable(apply(event, nullptr, {row}), std::move(done));
}

void CoordinatorModel::cancel(const std::string& job, Done done) {
  ground_.say("{} is cancelled", job);
  when_durable(apply(CancelEvent{job}, nullptr), std::move(done));
}

void CoordinatorModel::retry(const std::string& job, Done done) {
  const JobRow& row = journal_.tables().jobs.at(job);
  if (row.end != End::kFailed && row.end != End::kCancelled) {
    when_durable(journal_.append({}), std::move(done));
    return;
  }
  ground_.say("{} is tried again", job);
  process_->files[job] = JobFile{row.fabric, {}, 0, {}};
  const SubmitEvent event{
      job, row.fabric.name, row.fingerprint, row.submitted_at, row.demands, false, {}};
  std::vector<Row> rows{RetryRow{job}};
  when_durable(apply(event, nullptr, std::move(rows)), std::move(done));
}

void CoordinatorModel::pause(const std::string& job, bool is_paused, Done done) {
  if (process_->queue.job(job) == nullptr) {
    when_durable(journal_.append({}), std::move(done));
    return;
  }
  ground_.say("{} is {}", job, is_paused ? "paused" : "resumed");
  when_durable(apply(PauseEvent{job, is_paused}, nullptr, {PauseRow{job, is_paused}}),
               std::move(done));
}

void CoordinatorModel::prioritise(const std::string& job, std::int32_t priority, Done done) {
  if (process_->queue.job(job) == nullptr) {
    when_durable(journal_.append({}), std::move(done));
    return;
  }
  when_durable(apply(PriorityEvent{job, priority}, nullptr, {PriorityRow{job, priority}}),
               std::move(done));
}

void CoordinatorModel::drain(const std::string& worker_name, bool is_drained, Done done) {
  ground_.say("{} is {}", worker_name, is_drained ? "drained" : "undrained");
  when_durable(
      apply(DrainEvent{worker_name, is_drained}, nullptr, {DrainRow{worker_name, is_drained}}),
      std::move(done));
}

void CoordinatorModel::unblock(const std::string& worker_name, StageName stage, Done done) {
  ground_.say("{} is unblocked for {}", worker_name, to_string(stage));
  when_durable(apply(BlockEvent{worker_name, stage, false}, nullptr), std::move(done));
}

}  // namespace weft::simulation
