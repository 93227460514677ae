#include <algorithm>
#include <utility>

#include <spdlog/spdlog.h>

#include "coordinator/scheduler/scheduler.h"
#include "core/error.h"

// The scheduler's talk with workers. A call that waits holds no thread: it lies in waiting_ until
// the dispatcher, one thread for all of them, has something to say to it.

namespace weft::coordinator {

namespace {

constexpr auto kTick = std::chrono::seconds(1);
constexpr auto kWatchInterval = std::chrono::milliseconds(100);

// When there may be something to run, the calls that want work are looked at in turn, until so many
// in a row get nothing. The others have their turn within the next seconds, or with their next
// call.
constexpr std::size_t kFruitlessLimit = 64;

v1::AttemptName message_of(const AttemptName& name) {
  v1::AttemptName message;
  message.set_job_id(name.job);
  message.set_attempt(name.attempt);
  return message;
}

bool has_news(const Reply& reply) {
  return !reply.assignments.empty() || !reply.stop.empty() || !reply.acknowledged.empty();
}

}  // namespace

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

void Scheduler::synchronize(ReportEvent report, std::uint64_t sequence,
                            std::chrono::milliseconds wait, ExchangeAnswer answer) {
  std::unique_lock lock(mutex_);
  check_running();
  const std::string worker = report.worker;
  const auto known = queue_.workers().find(worker);
  if (known != queue_.workers().end() &&
      (known->second.fingerprint != report.fingerprint || known->second.name != report.name)) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "worker " + worker +
                          " is known with another name or numerics fingerprint; start it again, "
                          "under a new worker_id");
  }
  std::uint64_t& newest = sequences_[worker];
  if (sequence <= newest) {
    lock.unlock();
    answer(std::nullopt, std::nullopt);
    return;
  }
  if (known == queue_.workers().end() && !report.leaving) {
    spdlog::info("worker={} name={} threads={} event=joined", worker, report.name, report.threads);
  }
  newest = sequence;
  gone_.erase(worker);
  std::optional<WaitingCalls::Call> older = waiting_.take(worker);
  std::vector<PendingAnswer> answers;
  waiting_.keep({std::move(report), sequence, clock_.now() + wait, std::move(answer)});
  look_at(worker, false, answers);
  if (waiting_.find(worker) != nullptr) {
    dispatch_needed_.notify_one();  // the first deadline may be another
  }
  lock.unlock();
  if (older) {
    older->answer(std::nullopt, std::nullopt);
  }
  send(std::move(answers));
}

void Scheduler::abandon(const std::string& worker, std::uint64_t sequence) {
  std::unique_lock lock(mutex_);
  const auto newest = sequences_.find(worker);
  if (newest == sequences_.end() || newest->second != sequence) {
    return;  // it has called again
  }
  gone_[worker] = clock_.now() + std::chrono::milliseconds(options_.queue.disconnect_ms);
  std::optional<WaitingCalls::Call> call = waiting_.take(worker);
  dispatch_needed_.notify_one();
  lock.unlock();
  if (call) {
    call->answer(std::nullopt, std::nullopt);
  }
}

// Puts a waiting call to the queue (again) and takes it for an answer when there is something to
// say, its time is over, or nothing can be said any more. Whether it got something.
bool Scheduler::look_at(const std::string& worker, bool must_answer,
                        std::vector<PendingAnswer>& answers) {
  const WaitingCalls::Call* const call = waiting_.find(worker);
  if (call == nullptr) {
    return false;
  }
  PendingAnswer pending;
  try {
    Reply reply;
    pending.ticket = apply(call->report, &reply);
    const bool is_answered =
        must_answer || has_news(reply) || call->report.leaving || clock_.now() >= call->deadline;
    if (!is_answered) {
      return false;
    }
    pending.response = message(reply);
  } catch (const core::Error& error) {
    pending.problem = error;
  }
  pending.answer = waiting_.take(worker)->answer;
  answers.push_back(std::move(pending));
  return true;
}

void Scheduler::send(std::vector<PendingAnswer> answers) {
  for (PendingAnswer& pending : answers) {
    if (pending.problem) {
      pending.answer(std::nullopt, pending.problem);
      continue;
    }
    journal_.when_durable(pending.ticket, [answer = std::move(pending.answer),
                                           response = std::move(pending.response)](
                                              const std::optional<core::Error>& problem) mutable {
      answer(problem ? std::nullopt : std::optional(std::move(response)), problem);
    });
  }
}

void Scheduler::dispatch() {
  std::unique_lock lock(mutex_);
  next_tick_ = clock_.now();
  while (!stopping_ && fatal_.empty()) {
    std::vector<PendingAnswer> answers;
    dispatch_once(clock_.now(), answers);
    lock.unlock();
    send(std::move(answers));
    lock.lock();
    const auto pause = next_dispatch() - clock_.now();
    if (!stopping_ && !waiting_.has_concerned() && !is_wake_pending_ && pause.count() > 0) {
      dispatch_needed_.wait_for(lock, std::min<Time::duration>(pause, kTick));
    }
  }
  // Nothing can be promised any more: whoever waits is told so.
  const core::Error problem(core::Code::kUnavailable,
                            fatal_.empty() ? "the coordinator is stopping" : fatal_);
  stopping_ = true;
  const std::vector<WaitingCalls::Call> calls = waiting_.take_all();
  tasks_changed_.notify_all();
  jobs_changed_.notify_all();
  lock.unlock();
  for (const WaitingCalls::Call& call : calls) {
    call.answer(std::nullopt, problem);
  }
}

Time Scheduler::next_dispatch() const {
  Time next = next_tick_;
  if (const std::optional<Time> deadline = waiting_.first_deadline()) {
    next = std::min(next, *deadline);
  }
  for (const auto& [worker, lost_at] : gone_) {
    next = std::min(next, lost_at);
  }
  return watchers_ > 0 ? std::min<Time>(next, clock_.now() + kWatchInterval) : next;
}

void Scheduler::dispatch_once(Time now, std::vector<PendingAnswer>& answers) {
  try {
    if (now >= next_tick_ || now + 2 * kTick < next_tick_) {  // the clock may be set back
      next_tick_ = now + kTick;
      tick();
    }
    for (auto it = gone_.begin(); it != gone_.end();) {
      if (it->second > now) {
        ++it;
        continue;
      }
      spdlog::warn("worker={} event=connection_lost", it->first);
      apply(DisconnectEvent{it->first}, nullptr);
      it = gone_.erase(it);
    }
  } catch (const core::Error& error) {
    spdlog::error("event=journal_failed message=\"{}\"", error.what());
    return;
  }
  while (const std::optional<std::string> worker = waiting_.next_concerned()) {
    look_at(*worker, false, answers);
  }
  while (const std::optional<std::string> worker = waiting_.next_due(now)) {
    look_at(*worker, true, answers);
  }
  if (std::exchange(is_wake_pending_, false)) {
    serve_hungry(answers);
  }
  if (watchers_ > 0) {
    jobs_changed_.notify_all();
  }
}

void Scheduler::serve_hungry(std::vector<PendingAnswer>& answers) {
  std::size_t fruitless = 0;
  for (std::size_t left = waiting_.hungry(); left > 0 && fruitless < kFruitlessLimit; --left) {
    const std::optional<std::string> worker = waiting_.next_hungry();
    fruitless = worker && look_at(*worker, false, answers) ? 0 : fruitless + 1;
  }
}

void Scheduler::tick() {
  apply(TickEvent{}, nullptr);
  is_wake_pending_ = true;  // back-offs and retries become due without an event
  std::erase_if(sequences_, [&](const auto& entry) {
    return !queue_.workers().contains(entry.first) && waiting_.find(entry.first) == nullptr;
  });
}

}  // namespace weft::coordinator
