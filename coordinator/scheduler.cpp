#include "coordinator/scheduler.h"

#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/records.h"
#include "core/check.h"
#include "core/error.h"
#include "fabric/description.h"
#include "proto/arrays.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

constexpr auto kTick = std::chrono::seconds(1);

v1::FabricDescription parse_description(const std::string& bytes, const std::string& job) {
  v1::FabricDescription description;
  if (!description.ParseFromString(bytes)) {
    throw core::Error(core::Code::kDataLoss,
                      "the journal's description of job " + job + " is damaged");
  }
  return description;
}

v1::Job parse_summary(const JobRecord& record) {
  v1::Job job;
  if (!job.ParseFromString(record.summary)) {
    throw core::Error(core::Code::kDataLoss, "the journal's record of job " + record.id +
                                                 " is damaged; restore the state folder");
  }
  return job;
}

// Six bytes of a digest: the same request gives the same job.
std::string job_id_of(const std::string& request_id) {
  return "j" + core::digest_of(request_id).hex().substr(0, 12);
}

bool is_over(const v1::Job& job) {
  return job.state() == v1::JOB_STATE_SUCCEEDED || job.state() == v1::JOB_STATE_FAILED ||
         job.state() == v1::JOB_STATE_CANCELLED;
}

}  // namespace

Scheduler::Scheduler(SchedulerOptions options, const core::Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      journal_((std::filesystem::create_directories(options_.state_folder),
                options_.state_folder / "journal.db")),
      blobs_(options_.state_folder / "blobs"),
      catalogue_(journal_, options_.state_folder / "versions"),
      queue_(options_.queue, journal_.epoch()) {
  // What an earlier process was writing when it died is of no use.
  std::filesystem::remove_all(options_.state_folder / "committing");
  std::filesystem::create_directories(options_.state_folder / "committing");
  load();
  planner_ = std::thread([this] { work_through(to_plan_); });
  committer_ = std::thread([this] { work_through(to_commit_); });
  ticker_ = std::thread([this] { tick(); });
}

Scheduler::~Scheduler() {
  stop();
  planner_.join();
  committer_.join();
  ticker_.join();
}

void Scheduler::stop() {
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  changed_.notify_all();
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
  std::vector<JobRecord> jobs = journal_.jobs(kEndedJobsLimit);
  for (const JobRecord& record : jobs) {
    if (record.ended_at_ms == 0) {
      JobFile& file = files_[record.id];
      file.description = parse_description(record.description, record.id);
      file.comment = record.comment;
      apply(SubmitEvent{record.id,
                        record.fabric,
                        record.fingerprint,
                        Time(std::chrono::milliseconds(record.submitted_at_ms)),
                        {},
                        false},
            nullptr);
      continue;
    }
    ended_[record.id] = parse_summary(record);
    ended_order_.push_front(record.id);
  }
  spdlog::info("event=loaded epoch={} unfinished_jobs={} ended_jobs={}", journal_.epoch(),
               files_.size(), ended_.size());
}

// Applies an event and sees to what follows from it. The ticket is of all that it needs to be
// durable.
Journal::Ticket Scheduler::apply(const Event& event, Reply* reply) {
  Actions actions = queue_.apply(event, clock_.now());
  for (const BindRecord& bound : actions.bound) {
    spdlog::info("job={} event=bound fingerprint={}", bound.job,
                 bound.fingerprint.hex().substr(0, 12));
  }
  for (const FailureRecord& failure : actions.failures) {
    spdlog::warn("job={} stage={} shard={} worker={} event=failed message=\"{}\"", failure.job,
                 to_string(failure.stage), failure.shard, failure.worker, failure.message);
  }
  std::vector<Record> records = records_of(actions);
  for (const std::string& id : actions.ended) {
    end_job(id, records);
  }
  to_plan_.insert(to_plan_.end(), actions.plan.begin(), actions.plan.end());
  to_commit_.insert(to_commit_.end(), actions.commit.begin(), actions.commit.end());
  wakes_ += actions.wake ? 1 : 0;
  if (reply != nullptr) {
    *reply = std::move(actions.reply);
  }
  changed_.notify_all();
  try {
    return journal_.append(std::move(records));
  } catch (const core::Error& error) {
    fatal_ = error.what();
    throw;
  }
}

void Scheduler::end_job(const std::string& id, std::vector<Record>& records) {
  v1::Job job = message(id);
  spdlog::info("job={} fabric={} event=ended state={} error=\"{}\"", id, job.fabric(),
               v1::JobState_Name(job.state()), job.error());
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

v1::Job Scheduler::submit(const v1::SubmitRequest& request) {
  check_id(request.request_id(), "request_id");
  if (request.options().comment().size() > v1::kCommentLimitBytes) {
    throw core::Error(core::Code::kInvalidArgument, "options.comment is longer than 1024 bytes");
  }
  fabric::check_description(request.description());
  JobRecord record;
  record.id = job_id_of(request.request_id());
  record.request_id = request.request_id();
  record.fabric = request.description().name();
  record.description = v1::canonical_bytes(request.description());
  record.comment = request.options().comment();

  std::unique_lock lock(mutex_);
  check_running();
  if (std::optional<v1::Job> known = submitted_before(record)) {
    const Journal::Ticket ticket = journal_.append({});
    lock.unlock();
    journal_.wait(ticket);
    return *std::move(known);
  }
  if (files_.size() >= kUnfinishedJobsLimit) {
    throw core::Error(core::Code::kResourceExhausted,
                      "there are " + std::to_string(files_.size()) +
                          " unfinished jobs, which is the limit; wait for some, or cancel them");
  }
  const Time now = clock_.now();
  record.submitted_at_ms = to_ms(now);
  files_[record.id].description = request.description();
  files_[record.id].comment = record.comment;
  const SubmitEvent event{record.id, record.fabric, std::nullopt, now, {}, false};
  spdlog::info("job={} fabric={} event=submitted", record.id, record.fabric);
  const std::string id = record.id;
  journal_.append({std::move(record)});
  const Journal::Ticket ticket = apply(event, nullptr);
  v1::Job job = message(id);
  lock.unlock();
  journal_.wait(ticket);
  return job;
}

v1::Job Scheduler::cancel(const std::string& job_id) {
  std::unique_lock lock(mutex_);
  check_running();
  const std::string id = full_id(job_id);
  const Journal::Ticket ticket = apply(CancelEvent{id}, nullptr);
  v1::Job job = message(id);
  lock.unlock();
  journal_.wait(ticket);
  return job;
}

v1::Job Scheduler::job(const std::string& id_or_beginning) {
  const std::lock_guard lock(mutex_);
  return message(full_id(id_or_beginning));
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

std::vector<v1::Worker> Scheduler::workers() {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Worker> workers;
  for (const auto& [id, worker] : queue_.workers()) {
    workers.push_back(message_of(queue_, worker, clock_.now()));
  }
  std::stable_sort(workers.begin(), workers.end(),
                   [](const v1::Worker& a, const v1::Worker& b) { return a.name() < b.name(); });
  return workers;
}

v1::Job Scheduler::wait_for_change(const std::string& job_id, std::uint64_t seen,
                                   std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  const std::string id = full_id(job_id);
  v1::Job now;
  changed_.wait_for(lock, timeout, [&] {
    now = message(id);
    return stopping_ || is_over(now) || now.revision() != seen;
  });
  check_running();
  return now;
}

void Scheduler::tick() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    changed_.wait_for(lock, kTick, [&] { return stopping_; });
    try {
      apply(TickEvent{}, nullptr);
    } catch (const core::Error& error) {
      spdlog::error("event=journal_failed message=\"{}\"", error.what());
      return;
    }
    std::erase_if(sequences_,
                  [&](const auto& entry) { return !queue_.workers().contains(entry.first); });
  }
}

}  // namespace weft::coordinator
