#include "coordinator/scheduler/scheduler.h"

#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/journal/records_of.h"
#include "core/check.h"
#include "core/error.h"
#include "core/folder.h"
#include "core/named_thread.h"
#include "fabric/description.h"
#include "proto/arrays.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

// What is left of a job whose record is damaged, so that it keeps nothing else from starting.
v1::Job parse_summary(const JobRecord& record) {
  v1::Job job;
  if (!job.ParseFromString(record.summary) || job.id() != record.id) {
    spdlog::error("job={} event=damaged_record", record.id);
    job.Clear();
    job.set_id(record.id);
    job.set_fabric(record.fabric);
    job.set_state(v1::JOB_STATE_FAILED);
    job.set_error("the journal's record of how this job ended is damaged");
    job.set_user(record.demands.user);
    job.set_submitted_at_ms(record.submitted_at_ms);
    job.set_ended_at_ms(record.ended_at_ms);
  }
  return job;
}

// Six bytes of a digest: the same request gives the same job.
std::string job_id_of(const std::string& request_id) {
  return "j" + core::digest_of(request_id).hex().substr(0, 12);
}

}  // namespace

Scheduler::Scheduler(SchedulerOptions options, const core::Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      journal_((core::make_folder(options_.state_folder, "name another with --state"),
                options_.state_folder / "journal.db")),
      blobs_(options_.state_folder / "blobs"),
      catalogue_(journal_, options_.state_folder),
      logs_(options_.state_folder / "logs"),
      queue_(options_.queue, journal_.epoch()) {
  // What an earlier process was writing when it died is of no use.
  std::filesystem::remove_all(options_.state_folder / "committing");
  core::make_folder(options_.state_folder / "committing");
  catalogue_.set_remake([this](const VersionRecord& version) { return remake(version); });
  load();
  planner_ = core::named_thread("weft-plan", [this] { work_through(to_plan_); });
  committer_ = core::named_thread("weft-commit", [this] { work_through(to_commit_); });
  dispatcher_ = core::named_thread("weft-dispatch", [this] { dispatch(); });
}

Scheduler::~Scheduler() {
  stop();
  planner_.join();
  committer_.join();
  dispatcher_.join();
}

void Scheduler::stop() {
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  tasks_changed_.notify_all();
  jobs_changed_.notify_all();
  dispatch_needed_.notify_all();
}

std::optional<std::string> Scheduler::fatal_problem() {
  const std::lock_guard lock(mutex_);
  return fatal_.empty() ? std::nullopt : std::optional(fatal_);
}

void Scheduler::check_running() const {
  if (!fatal_.empty()) {
    throw core::Error(core::Code::kUnavailable, fatal_);
  }
  if (stopping_) {
    throw core::Error(core::Code::kUnavailable, "the coordinator is stopping");
  }
}

void Scheduler::load() {
  const std::lock_guard lock(mutex_);
  for (const std::string& name : journal_.drained()) {
    apply(DrainEvent{name, true}, nullptr);
  }
  for (const BlockRecord& block : journal_.blocks()) {
    apply(BlockEvent{block.worker, block.stage, true, block.is_liar}, nullptr);
  }
  for (const std::string& id : journal_.orders()) {
    orders_.add(id);
  }
  for (const JobRecord& record : journal_.jobs(kEndedJobsLimit)) {
    if (record.ended_at_ms == 0) {
      load(record);
      continue;
    }
    ended_[record.id] = parse_summary(record);
    ended_order_.push_front(record.id);
  }
  spdlog::info("event=loaded epoch={} unfinished_jobs={} ended_jobs={}", journal_.epoch(),
               files_.size(), ended_.size());
}

// Takes an unfinished job of the journal into the queue. One whose description cannot be read ends,
// so that it keeps nothing else from starting.
void Scheduler::load(const JobRecord& record) {
  JobFile& file = files_[record.id];
  file.comment = record.comment;
  file.user = record.demands.user;
  const bool is_readable = file.description.ParseFromString(record.description);
  const Time submitted_at(std::chrono::milliseconds(record.submitted_at_ms));
  apply(SubmitEvent{record.id, record.fabric, record.fingerprint, submitted_at, record.demands,
                    record.is_paused, journal_.mismatches_of(record.id)},
        nullptr);
  if (!is_readable) {
    apply(JobFailedEvent{record.id, 0,
                         "the journal's description of this job is damaged; submit it again"},
          nullptr);
  }
}

// Applies an event and sees to what follows from it. `records` come before what the event itself
// asks to be kept. The ticket is of all that it needs to be durable.
Journal::Ticket Scheduler::apply(const Event& event, Reply* reply, std::vector<Record> records) {
  Actions actions = queue_.apply(event, clock_.now());
  log(actions);
  if (options_.hooks.acted) {
    options_.hooks.acted(actions);
  }
  std::vector<Record> of_event = records_of(actions);
  records.insert(records.end(), std::make_move_iterator(of_event.begin()),
                 std::make_move_iterator(of_event.end()));
  if (recent_.is_kept) {
    for (const ResultDropRecord& drop : actions.results_dropped) {
      recent_.by_shard[drop.shard] = std::nullopt;
    }
    for (const ResultRecord& result : actions.results) {
      recent_.by_shard[result.shard] = KeptResult{result.result, result.worker, false};
    }
  }
  for (const AttemptEndRecord& end : actions.attempts_ended) {
    waiting_.attempt_ended(end.attempt);
  }
  for (const std::string& id : actions.ended) {
    end_job(id, records);
  }
  for (PlanAction& plan : actions.plan) {
    to_plan_.push_back({std::move(plan)});
  }
  for (CommitAction& commit : actions.commit) {
    to_commit_.push_back({std::move(commit)});
  }
  if (!actions.plan.empty() || !actions.commit.empty()) {
    tasks_changed_.notify_all();
  }
  is_wake_pending_ = is_wake_pending_ || actions.wake;
  if (is_wake_pending_ || waiting_.has_concerned()) {
    dispatch_needed_.notify_one();
  }
  if (reply != nullptr) {
    *reply = std::move(actions.reply);
  }
  try {
    return journal_.append(std::move(records));
  } catch (const core::Error& error) {
    fatal_ = error.what();
    throw;
  }
}

void Scheduler::log(const Actions& actions) const {
  for (const BindRecord& bound : actions.bound) {
    spdlog::info("job={} event=bound fingerprint={}", bound.job,
                 bound.fingerprint.hex().substr(0, 12));
  }
  for (const FailureRecord& failure : actions.failures) {
    spdlog::warn("job={} stage={} shard={} worker={} event=failed message=\"{}\"", failure.job,
                 to_string(failure.stage), failure.shard, failure.worker, failure.message);
  }
  for (const BlockRecord& block : actions.blocks) {
    spdlog::warn("worker={} stage={} event={} liar={}", block.worker, to_string(block.stage),
                 block.is_blocked ? "blocked" : "unblocked", block.is_liar);
  }
  for (const MismatchRecord& mismatch : actions.mismatches) {
    spdlog::error("job={} stage={} shard={} event=results_differ worker={} other_worker={} liar={}",
                  mismatch.job, to_string(mismatch.stage), mismatch.shard, mismatch.worker,
                  mismatch.other_worker, mismatch.liar.empty() ? "unknown" : mismatch.liar);
  }
  for (const AttemptEndRecord& end : actions.attempts_ended) {
    if (end.outcome == Outcome::kLost || end.outcome == Outcome::kHung) {
      spdlog::warn("job={} attempt={} event={} message=\"{}\"", end.job, end.attempt,
                   to_string(end.outcome), end.message);
    }
  }
}

void Scheduler::end_job(const std::string& id, std::vector<Record>& records) {
  v1::Job job = message(id);
  spdlog::info("job={} fabric={} event=ended state={} error=\"{}\"", id, job.fabric(),
               v1::JobState_Name(job.state()), job.error());
  if (options_.hooks.job_ended) {
    options_.hooks.job_ended(job);
  }
  records.emplace_back(JobEndRecord{id, job.ended_at_ms(), v1::canonical_bytes(job)});
  ended_[id] = std::move(job);
  ended_order_.push_back(id);
  while (ended_order_.size() > kEndedJobsLimit) {
    ended_.erase(ended_order_.front());
    ended_order_.pop_front();
  }
  files_.erase(id);
  queue_.forget_job(id);
}

v1::Job Scheduler::message(const std::string& id) const {
  const auto ended = ended_.find(id);
  if (ended != ended_.end()) {
    return ended->second;
  }
  const JobState* const job = queue_.job(id);
  CHECK(job != nullptr);
  v1::Job message = message_of(queue_, *job, clock_.now());
  const JobFile& file = files_.at(id);
  message.set_comment(file.comment);
  message.set_user(file.user);
  message.set_revision(file.first_revision + message.revision());
  if (!file.problem.empty()) {
    message.set_waiting_for(file.problem);
  }
  message.set_cached_bytes(file.cached_bytes);
  if (file.version) {
    *message.mutable_version() = message_of(*file.version);
  }
  return message;
}

std::string Scheduler::full_id(const std::string& beginning) const {
  std::vector<std::string> ids;
  const auto look_at = [&](const auto& jobs) {
    for (auto it = jobs.lower_bound(beginning);
         it != jobs.end() && it->first.starts_with(beginning); ++it) {
      ids.push_back(it->first);
    }
  };
  if (!beginning.empty()) {
    look_at(files_);
    look_at(ended_);
  }
  if (ids.empty()) {
    throw core::Error(core::Code::kNotFound,
                      "there is no job '" + beginning + "'; ListJobs (weft jobs) names all");
  }
  if (ids.size() > 1) {
    throw core::Error(core::Code::kInvalidArgument, "'" + beginning + "' begins the names of " +
                                                        std::to_string(ids.size()) +
                                                        " jobs; write more of it");
  }
  return ids.front();
}

// The job of the same request, when that was seen before.
std::optional<v1::Job> Scheduler::submitted_before(const JobRecord& record) {
  const auto file = files_.find(record.id);
  const std::optional<JobRecord> before =
      file == files_.end() ? journal_.job_of_request(record.request_id) : std::nullopt;
  if (file == files_.end() && !before) {
    return std::nullopt;
  }
  if (record.description !=
      (before ? before->description : v1::canonical_bytes(file->second.description))) {
    throw core::Error(
        core::Code::kAlreadyExists,
        "request_id " + record.request_id + " was used for another description; choose a new one");
  }
  const bool is_in_memory = file != files_.end() || ended_.contains(record.id);
  return is_in_memory ? message(record.id) : parse_summary(*before);
}

// What may be refused though the description is right, each limit by its name.
void Scheduler::check_limits(const std::string& user) const {
  const auto refuse = [](const std::string& limit, const std::string& what) {
    throw core::Error(core::Code::kResourceExhausted, limit + ": " + what);
  };
  if (files_.size() >= kUnfinishedJobsLimit) {
    refuse("unfinished_jobs_limit", "there are " + std::to_string(files_.size()) +
                                        " unfinished jobs, which is the limit; wait for some, or "
                                        "cancel them");
  }
  const std::size_t jobs = queue_.unfinished_jobs_of(user);
  if (jobs >= options_.queue.user_jobs_limit) {
    refuse("user_jobs_limit", user + " has " + std::to_string(jobs) +
                                  " unfinished jobs, which is the limit of one user; wait for "
                                  "some, or cancel them");
  }
  check_journal_limit();
}

void Scheduler::check_journal_limit() const {
  const std::uint64_t size = journal_.size_bytes();
  if (size >= options_.journal_limit_bytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      "journal_limit_bytes: the journal has grown to " + std::to_string(size) +
                          " bytes; remove results that no version needs (weft gc), or raise the "
                          "coordinator's limit");
  }
}

v1::Job Scheduler::submit(const v1::SubmitRequest& request, const security::Caller& caller) {
  check_id(request.request_id(), "request_id");
  if (request.description().ByteSizeLong() > v1::kDescriptionLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      "description_bytes_limit: the description has " +
                          std::to_string(request.description().ByteSizeLong()) +
                          " bytes, and may have " + std::to_string(v1::kDescriptionLimitBytes));
  }
  fabric::check_description(request.description());
  JobRecord record;
  record.id = job_id_of(request.request_id());
  record.request_id = request.request_id();
  record.fabric = request.description().name();
  record.description = v1::canonical_bytes(request.description());
  record.comment = request.options().comment();
  record.demands = demands_from(request.options(), caller);

  std::unique_lock lock(mutex_);
  check_running();
  if (std::optional<v1::Job> known = submitted_before(record)) {
    const Journal::Ticket ticket = journal_.append({});
    lock.unlock();
    journal_.wait(ticket);
    return *std::move(known);
  }
  check_limits(record.demands.user);
  const Time now = clock_.now();
  record.submitted_at_ms = to_ms(now);
  JobFile& file = files_[record.id];
  file.description = request.description();
  file.comment = record.comment;
  file.user = record.demands.user;
  const SubmitEvent event{record.id, record.fabric, std::nullopt, now, record.demands, false, {}};
  spdlog::info("job={} fabric={} user={} event=submitted", record.id, record.fabric, file.user);
  const std::string id = record.id;
  std::vector<Record> records;
  records.emplace_back(std::move(record));
  const Journal::Ticket ticket = apply(event, nullptr, std::move(records));
  v1::Job job = message(id);
  lock.unlock();
  journal_.wait(ticket);
  return job;
}

// What was told stays so: what is known of the job is durable before it is said.
v1::Job Scheduler::told(const std::string& id, std::unique_lock<std::mutex>& lock) {
  v1::Job job = message(id);
  const Journal::Ticket ticket = journal_.append({});
  lock.unlock();
  journal_.wait(ticket);
  return job;
}

v1::Job Scheduler::job(const std::string& id_or_beginning) {
  std::unique_lock lock(mutex_);
  return told(full_id(id_or_beginning), lock);
}

std::vector<v1::Job> Scheduler::jobs(bool unfinished_only, std::size_t limit) {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Job> jobs;
  for (const auto& [id, file] : files_) {
    jobs.push_back(message(id));
  }
  if (!unfinished_only) {
    for (const auto& [id, job] : ended_) {
      jobs.push_back(job);
    }
  }
  std::stable_sort(jobs.begin(), jobs.end(), [](const v1::Job& a, const v1::Job& b) {
    return a.submitted_at_ms() > b.submitted_at_ms();
  });
  jobs.resize(std::min(jobs.size(), limit));
  return jobs;
}

v1::Job Scheduler::wait_for_change(const std::string& job_id, std::uint64_t seen,
                                   std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  const std::string id = full_id(job_id);
  ++watchers_;
  dispatch_needed_.notify_one();
  jobs_changed_.wait_for(lock, timeout, [&] { return stopping_ || revision_of(id) != seen; });
  --watchers_;
  check_running();
  return told(id, lock);
}

// Nothing of a job that has ended: its last message is told whatever the caller saw.
std::optional<std::uint64_t> Scheduler::revision_of(const std::string& id) const {
  const JobState* const job = queue_.job(id);
  return job == nullptr ? std::nullopt
                        : std::optional(files_.at(id).first_revision + job->revision);
}

}  // namespace weft::coordinator
