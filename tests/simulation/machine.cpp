#include "tests/simulation/machine.h"

#include <algorithm>

#include "core/check.h"

// A worker's process and its talk with the coordinator; see machine_work.cpp for what it computes.

namespace weft::simulation {

namespace {

constexpr std::uint64_t kAnswerAllowanceMs = 10'000;
constexpr std::uint64_t kLongestBackOffMs = 5'000;
constexpr std::uint32_t kLongestWaitMs = 5'000;
constexpr std::uint32_t kShortestWaitMs = 200;
constexpr std::uint64_t kLeavingMs = 10'000;

}  // namespace

std::string Machine::worker_id() const { return character_.name + "-" + std::to_string(starts_); }

bool Machine::is_idle() const {
  return spool_.empty() && (!process_ || (process_->table.is_empty() && process_->busy == 0));
}

bool Machine::is_cut_off() const { return ground_.timeline.now_ms() < cut_off_until_ms_; }

void Machine::start() {
  if (process_) {
    return;
  }
  ++life_;
  ++starts_;
  process_ = std::make_unique<Process>(character_.threads);
  process_->started_ms = ground_.timeline.now_ms();
  if (character_.wall_limit_ms > 0) {
    later(character_.wall_limit_ms - kLeavingMs, [this] { leave(); });
  }
  ground_.say("{} starts with {} attempts to report", worker_id(), spool_.size());
  take_over_spool();
  later(ground_.between(0, 100), [this] { synchronize(); });
}

void Machine::kill() {
  if (!process_) {
    return;
  }
  ground_.say("{} dies", worker_id());
  end();
}

void Machine::end() {
  ++life_;
  process_.reset();
  frozen_until_ms_ = 0;
  // The kernel closes its connection, which the coordinator sees where the network is there.
  if (!is_cut_off()) {
    ground_.timeline.after(ground_.between(0, 50), [this, worker = worker_id()] {
      if (coordinator_.is_up()) {
        coordinator_.connection_closed(worker);
      }
    });
  }
}

void Machine::leave() {
  if (process_ && !process_->is_leaving) {
    ground_.say("{} leaves", worker_id());
    process_->is_leaving = true;
    process_->table.drain();
    later(kLeavingMs, [this] { end(); });
    attempt_is_over();
  }
}

void Machine::freeze(std::uint64_t for_ms) {
  if (process_) {
    ground_.say("{} is stopped for {} ms", worker_id(), for_ms);
    frozen_until_ms_ = ground_.timeline.now_ms() + for_ms;
  }
}

void Machine::cut_off(std::uint64_t for_ms) {
  ground_.say("{} is cut off for {} ms", character_.name, for_ms);
  cut_off_until_ms_ = ground_.timeline.now_ms() + for_ms;
}

void Machine::mend() {
  cut_off_until_ms_ = 0;
  frozen_until_ms_ = 0;
  start();
}

// Does something later, unless the process has died by then; a stopped process does it afterwards.
void Machine::later(std::uint64_t delay_ms, std::function<void()> action) {
  ground_.timeline.after(
      delay_ms, [this, life = life_, action = std::move(action)] { run_alive(life, action); });
}

void Machine::run_alive(std::uint64_t life, const std::function<void()>& action) {
  if (life != life_ || !process_) {
    return;
  }
  const std::uint64_t now_ms = ground_.timeline.now_ms();
  if (now_ms < frozen_until_ms_) {
    ground_.timeline.after(frozen_until_ms_ - now_ms,
                           [this, life, action] { run_alive(life, action); });
    return;
  }
  action();
}

// Carries a call to the coordinator. Where that is down, the refusal comes back at once.
void Machine::call_coordinator(const std::function<void()>& call,
                               const std::function<void()>& refused) {
  ground_.carry([this, life = life_, starts = coordinator_.starts(), call, refused] {
    if (is_cut_off()) {
      return;
    }
    // A connection does not outlive the process that it was made to.
    if (coordinator_.is_up() && coordinator_.starts() == starts) {
      call();
    } else {
      ground_.carry([this, life, refused] { run_alive(life, refused); });
    }
  });
}

v1::SynchronizeRequest Machine::next_request() {
  Process& process = *process_;
  v1::SynchronizeRequest request;
  ++process.sequence;
  request.set_request_id(worker_id() + "-" + std::to_string(process.sequence));
  request.set_worker_id(worker_id());
  request.set_sequence(process.sequence);
  request.set_name(character_.name);
  request.set_threads(character_.threads);
  request.set_memory_bytes(character_.memory_bytes);
  request.set_fingerprint(character_.fingerprint.binary());
  request.set_leaving(process.is_leaving);
  request.set_wait_ms(process.is_leaving ? 0 : process.wait_ms);
  if (character_.wall_limit_ms > 0) {
    const std::uint64_t ran_ms = ground_.timeline.now_ms() - process.started_ms;
    const std::uint64_t usable_ms = character_.wall_limit_ms - kLeavingMs;
    request.set_wall_left_ms(usable_ms > ran_ms ? usable_ms - ran_ms : 1);
  }
  for (const std::string& label : character_.labels) {
    request.add_labels(label);
  }
  process.table.fill(request);
  process.free_told = request.free_attempts();
  return request;
}

void Machine::synchronize() {
  if (process_->call != 0) {
    return;
  }
  const v1::SynchronizeRequest request = next_request();
  const std::uint64_t sequence = request.sequence();
  process_->call = sequence;
  const auto answer = [this, sequence, life = life_](const v1::SynchronizeResponse* response) {
    ground_.carry([this, sequence, life, is_aborted = response == nullptr,
                   copy = response == nullptr ? v1::SynchronizeResponse() : *response] {
      if (is_cut_off()) {
        return;
      }
      run_alive(life, [this, sequence, is_aborted, copy] {
        if (!is_aborted) {
          answered(sequence, copy);
        } else if (process_->call == sequence) {
          process_->call = 0;
          synchronize();
        }
      });
    });
  };
  call_coordinator([this, request, answer] { coordinator_.synchronize(request, answer); },
                   [this, sequence] { unanswered(sequence); });
  later(request.wait_ms() + kAnswerAllowanceMs, [this, sequence] { unanswered(sequence); });
}

void Machine::unanswered(std::uint64_t sequence) {
  if (process_->call != sequence) {
    return;
  }
  process_->call = 0;
  process_->back_off_ms =
      std::clamp<std::uint64_t>(2 * process_->back_off_ms, 100, kLongestBackOffMs);
  later(process_->back_off_ms, [this] { synchronize(); });
}

// An answer to a call that was given up is dropped with its connection.
void Machine::answered(std::uint64_t sequence, const v1::SynchronizeResponse& response) {
  Process& process = *process_;
  if (process.call != sequence) {
    return;
  }
  process.call = 0;
  process.back_off_ms = 0;
  std::uint32_t shortest_lease_ms = 3 * kLongestWaitMs;
  for (const v1::Lease& lease : response.leases()) {
    shortest_lease_ms = std::min(shortest_lease_ms, lease.lease_ms());
  }
  for (const v1::Assignment& assignment : response.assignments()) {
    shortest_lease_ms = std::min(shortest_lease_ms, assignment.lease_ms());
  }
  process.wait_ms = std::clamp(shortest_lease_ms / 3, kShortestWaitMs, kLongestWaitMs);
  const worker::AttemptTable::Changes changes = process.table.apply(response);
  for (const auto& attempt : changes.assigned) {
    const v1::AttemptName& name = attempt->assignment.name();
    ground_.say("{} gets {}", worker_id(), worker::log_name(*attempt));
    if (!process.begun.insert({name.job_id(), name.attempt()}).second) {
      throw Violation(worker_id() + " begins attempt " + std::to_string(name.attempt()) +
                      " a second time");
    }
  }
  for (const auto& attempt : changes.revoked) {
    ground_.say("{} stops {}", worker_id(), worker::log_name(*attempt));
  }
  if (process.is_leaving && process.table.is_empty()) {
    ground_.say("{} has left", worker_id());
    end();
    return;
  }
  attempt_is_over();
  work();
  later(process.is_leaving ? 50 : 0, [this] { synchronize(); });
}

// Gives up the call that waits and makes the next one.
void Machine::tell_news() {
  Process& process = *process_;
  if (process.call != 0) {
    const std::uint64_t sequence = process.call;
    process.call = 0;
    ground_.carry([this, worker = worker_id(), sequence] {
      if (coordinator_.is_up() && !is_cut_off()) {
        coordinator_.hang_up(worker, sequence);
      }
    });
  }
  later(ground_.between(0, 3), [this] { synchronize(); });
}

}  // namespace weft::simulation
