#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/queue/explain.h"
#include "coordinator/scheduler/scheduler.h"
#include "core/error.h"

// What people order about jobs and workers, and what they ask about attempts.

namespace weft::coordinator {

namespace {

constexpr std::size_t kAttemptsListed = 1000;

// A job is changed by its user or by an admin; `caller` is who asks.
void check_may_change(const v1::Job& job, const security::Caller& caller) {
  if (caller.may(v1::ROLE_ADMIN) || caller.user == job.user()) {
    return;
  }
  throw core::Error(core::Code::kPermissionDenied, "job " + job.id() + " belongs to " + job.user() +
                                                       "; only its user or an admin may change it");
}

StageName stage_named(const std::string& name) {
  for (const StageName stage : all_stages()) {
    if (name == to_string(stage)) {
      return stage;
    }
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "there is no stage '" + name +
                        "'; they are geometry, grid, visibility, basis, coefficients, transfer "
                        "and shadow");
}

[[noreturn]] void throw_no_worker(const std::string& name) {
  throw core::Error(core::Code::kNotFound,
                    "there is no worker '" + name + "'; ListWorkers (weft workers) names all");
}

// Of a job that the queue has forgotten.
v1::ExplainResponse explain_ended(const v1::Job& job) {
  v1::ExplainResponse response;
  response.set_subject("job " + job.id());
  std::string verdict = "was cancelled";
  if (job.state() == v1::JOB_STATE_SUCCEEDED) {
    verdict = "succeeded: " + job.version().fabric() + "@" + std::to_string(job.version().number());
  } else if (job.state() == v1::JOB_STATE_FAILED) {
    verdict = "failed: " + job.error();
  }
  response.set_verdict(verdict);
  v1::Reason& reason = *response.add_reasons();
  reason.set_code(reason::kEnded);
  reason.set_text("it has ended");
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    reason.set_mend("'weft retry " + job.id() + "' puts it back into the queue");
  }
  return response;
}

}  // namespace

v1::Job Scheduler::change_job(const Order& order, bool must_be_unfinished, const Change& change) {
  check_id(order.request_id, "request_id");
  std::unique_lock lock(mutex_);
  check_running();
  const std::string id = full_id(order.subject);
  check_may_change(message(id), order.caller);
  Journal::Ticket ticket = 0;
  if (orders_.contains(order.request_id)) {
    ticket = journal_.append({});
  } else {
    if (must_be_unfinished && !files_.contains(id)) {
      throw core::Error(core::Code::kFailedPrecondition, "job " + id + " has ended");
    }
    orders_.add(order.request_id);
    ticket = change(id, {OrderRecord{order.request_id}});
  }
  v1::Job job = message(id);
  lock.unlock();
  journal_.wait(ticket);
  return job;
}

v1::Job Scheduler::cancel(const Order& order) {
  return change_job(order, false, [&](const std::string& id, std::vector<Record> records) {
    spdlog::info("job={} event=cancelled user={}", id, order.caller.user);
    return apply(CancelEvent{id}, nullptr, std::move(records));
  });
}

v1::Job Scheduler::pause(const Order& order, bool is_paused) {
  return change_job(order, true, [&](const std::string& id, std::vector<Record> records) {
    spdlog::info("job={} event={} user={}", id, is_paused ? "paused" : "resumed",
                 order.caller.user);
    records.emplace_back(PauseRecord{id, is_paused});
    return apply(PauseEvent{id, is_paused}, nullptr, std::move(records));
  });
}

v1::Job Scheduler::set_priority(const Order& order, std::int32_t priority) {
  check_priority(priority);
  return change_job(order, true, [&](const std::string& id, std::vector<Record> records) {
    spdlog::info("job={} event=priority_set priority={} user={}", id, priority, order.caller.user);
    records.emplace_back(PriorityRecord{id, priority});
    return apply(PriorityEvent{id, priority}, nullptr, std::move(records));
  });
}

v1::Job Scheduler::retry(const Order& order) {
  return change_job(order, false, [&](const std::string& id, std::vector<Record> records) {
    return files_.contains(id) ? journal_.append(std::move(records))
                               : put_back(id, std::move(records));
  });
}

// Puts a job that has ended back into the queue.
Journal::Ticket Scheduler::put_back(const std::string& id, std::vector<Record> records) {
  const v1::Job& ended = ended_.at(id);
  if (ended.state() == v1::JOB_STATE_SUCCEEDED) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "job " + id + " has succeeded; submit the description again to repeat it");
  }
  std::optional<JobRecord> record = journal_.job(id);
  v1::FabricDescription description;
  if (!record || !description.ParseFromString(record->description)) {
    throw core::Error(core::Code::kFailedPrecondition, "the journal's description of job " + id +
                                                           " is gone or damaged; submit it again");
  }
  check_limits(record->demands.user);
  JobFile& file = files_[id];
  file.description = std::move(description);
  file.comment = record->comment;
  file.user = record->demands.user;
  file.first_revision = ended.revision() + 1;
  ended_.erase(id);
  std::erase(ended_order_, id);
  spdlog::info("job={} event=put_back", id);
  records.emplace_back(RetryRecord{id});
  const Time submitted_at(std::chrono::milliseconds(record->submitted_at_ms));
  return apply(SubmitEvent{id,
                           record->fabric,
                           record->fingerprint,
                           submitted_at,
                           std::move(record->demands),
                           false,
                           {}},
               nullptr, std::move(records));
}

std::vector<v1::AttemptInfo> Scheduler::attempts(const v1::ListAttemptsRequest& request) {
  std::unique_lock lock(mutex_);
  const std::string id = full_id(request.job_id());
  lock.unlock();
  const std::optional<StageName> stage =
      request.stage().empty() ? std::nullopt : std::optional(stage_named(request.stage()));
  const std::vector<KeptAttempt> kept =
      journal_.attempts_of(id, kAttemptsListed, [&](const AttemptRecord& attempt) {
        const bool has_shard = request.shard() >= attempt.first_shard &&
                               request.shard() - attempt.first_shard < attempt.shards;
        return (!stage || attempt.stage == *stage) && (!request.with_shard() || has_shard);
      });
  std::vector<v1::AttemptInfo> attempts;
  lock.lock();
  for (const KeptAttempt& attempt : kept) {
    v1::AttemptInfo& info = attempts.emplace_back(message_of(attempt));
    const auto live = queue_.attempts().find(attempt.begin.attempt);
    if (!attempt.end && live != queue_.attempts().end()) {
      info.set_shards_done(live->second.shards_done);
      info.set_last_line(live->second.last_line);
    }
    info.set_log_bytes(logs_.size(id, attempt.begin.attempt));
  }
  return attempts;
}

bool Scheduler::was_given(const std::string& job_id, std::uint64_t attempt,
                          const std::string& token) {
  {
    const std::lock_guard lock(mutex_);
    if (full_id(job_id) != job_id) {
      return false;
    }
    const auto live = queue_.attempts().find(attempt);
    if (live != queue_.attempts().end()) {
      return live->second.job == job_id && live->second.token == token;
    }
  }
  const auto is_it = [&](const AttemptRecord& record) { return record.attempt == attempt; };
  return !journal_.attempts_of(job_id, 1, is_it).empty();
}

std::vector<v1::Worker> Scheduler::workers() {
  const std::lock_guard lock(mutex_);
  std::vector<v1::Worker> workers =
      messages_of_workers(queue_, clock_.now(), [](const WorkerState&) { return true; });
  std::stable_sort(workers.begin(), workers.end(),
                   [](const v1::Worker& a, const v1::Worker& b) { return a.name() < b.name(); });
  return workers;
}

Census Scheduler::census() {
  const std::lock_guard lock(mutex_);
  return census_of(queue_, clock_.now());
}

// The worker that has this name, this id, or alone an id that begins so; nothing when there is
// none.
const WorkerState* Scheduler::find_worker(const std::string& name_or_id) const {
  std::vector<const WorkerState*> found;
  for (const auto& [id, worker] : queue_.workers()) {
    if (worker.name == name_or_id || id == name_or_id) {
      return &worker;
    }
    if (!name_or_id.empty() && id.starts_with(name_or_id)) {
      found.push_back(&worker);
    }
  }
  if (found.size() > 1) {
    throw core::Error(core::Code::kInvalidArgument, "'" + name_or_id + "' begins the ids of " +
                                                        std::to_string(found.size()) +
                                                        " workers; write more of it");
  }
  return found.empty() ? nullptr : found.front();
}

std::string Scheduler::worker_name(const std::string& name_or_id) const {
  const WorkerState* const worker = find_worker(name_or_id);
  if (worker != nullptr) {
    return worker->name;
  }
  // A machine that is away may still be drained or blocked.
  if (!queue_.is_drained(name_or_id) && queue_.blocked_stages(name_or_id).empty()) {
    throw_no_worker(name_or_id);
  }
  return name_or_id;
}

v1::ExplainResponse Scheduler::explain(const v1::ExplainRequest& request) {
  const std::lock_guard lock(mutex_);
  const Time now = clock_.now();
  switch (request.subject_case()) {
    case v1::ExplainRequest::kJobId: {
      const std::string id = full_id(request.job_id());
      const JobState* const job = queue_.job(id);
      return job == nullptr ? explain_ended(ended_.at(id)) : explain_job(queue_, *job, now);
    }
    case v1::ExplainRequest::kTask: {
      const std::string id = full_id(request.task().job_id());
      (void)stage_named(request.task().stage());
      const JobState* const job = queue_.job(id);
      return job == nullptr
                 ? explain_ended(ended_.at(id))
                 : explain_task(queue_, *job, request.task().stage(), request.task().shard(), now);
    }
    case v1::ExplainRequest::kWorker: {
      const WorkerState* const worker = find_worker(request.worker());
      if (worker == nullptr) {
        throw_no_worker(request.worker());
      }
      return explain_worker(queue_, *worker, now);
    }
    case v1::ExplainRequest::SUBJECT_NOT_SET:
      break;
  }
  throw core::Error(core::Code::kInvalidArgument, "the request names no job, task or worker");
}

std::vector<v1::Worker> Scheduler::change_worker(const Order& order, const Change& change) {
  check_id(order.request_id, "request_id");
  std::unique_lock lock(mutex_);
  check_running();
  const std::string name = worker_name(order.subject);
  Journal::Ticket ticket = 0;
  if (orders_.contains(order.request_id)) {
    ticket = journal_.append({});
  } else {
    orders_.add(order.request_id);
    ticket = change(name, {OrderRecord{order.request_id}});
  }
  std::vector<v1::Worker> workers = messages_of_workers(
      queue_, clock_.now(), [&](const WorkerState& worker) { return worker.name == name; });
  lock.unlock();
  journal_.wait(ticket);
  return workers;
}

std::vector<v1::Worker> Scheduler::drain(const Order& order, bool is_drained) {
  return change_worker(order, [&](const std::string& name, std::vector<Record> records) {
    spdlog::info("worker_name={} event={} user={}", name, is_drained ? "drained" : "undrained",
                 order.caller.user);
    records.emplace_back(DrainRecord{name, is_drained});
    return apply(DrainEvent{name, is_drained}, nullptr, std::move(records));
  });
}

std::vector<v1::Worker> Scheduler::unblock(const Order& order, const std::string& stage) {
  const std::vector<StageName> stages =
      stage.empty() ? all_stages() : std::vector{stage_named(stage)};
  return change_worker(order, [&](const std::string& name, std::vector<Record> records) {
    spdlog::info("worker_name={} event=unblocked stage={} user={}", name,
                 stage.empty() ? "all" : stage, order.caller.user);
    Journal::Ticket ticket = 0;
    for (const StageName each : stages) {
      records.emplace_back(BlockRecord{name, each, false, false});
      ticket = apply(BlockEvent{name, each, false, false}, nullptr, std::move(records));
      records.clear();
    }
    return ticket;
  });
}

}  // namespace weft::coordinator
