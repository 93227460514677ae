#include <algorithm>

#include "coordinator/queue/queue.h"

// What time shows: attempts that hang, attempts that are slow, and a clock that jumped.

namespace weft::coordinator {

// Looks at every attempt, once a tick.
void Queue::watch(Time now, Actions& actions) {
  std::vector<std::uint64_t> hung;
  const bool had_slow = !slow_.empty();
  slow_.clear();
  for (const auto& [worker, attempts] : attempts_of_worker_) {
    watch_worker(attempts, now, &hung);
  }
  for (const std::uint64_t id : hung) {
    take_away(id, now, actions);
  }
  actions.wake = actions.wake || (!had_slow && !slow_.empty());
}

// A worker does its attempts one after another: each is expected to begin when the one before is.
void Queue::watch_worker(const std::set<std::uint64_t>& attempts, Time now,
                         std::vector<std::uint64_t>* hung) {
  using Ms = std::chrono::duration<double, std::milli>;
  const auto worker = workers_.find(attempts_.at(*attempts.begin()).worker);
  if (worker != workers_.end() && !worker->second.undelivered.empty()) {
    return;  // it waits for us
  }
  const std::uint32_t threads = worker == workers_.end() ? 1 : worker->second.threads;
  double free_in_ms = -1e18;  // from now, when the attempts before are done
  bool is_known = true;       // how long these take
  for (const std::uint64_t id : attempts) {
    const Attempt& attempt = attempts_.at(id);
    const StageState& stage = job(attempt.job)->stages[attempt.stage];
    const double run_ms = expected_ms(stage, attempt.shards, threads);
    const bool is_first = id == *attempts.begin();
    const Time begin = is_first ? std::max(attempt.active_at, attempt.began_at) : attempt.began_at;
    const double waited_ms = Ms(now - begin).count();
    is_known = is_known && run_ms > 0;
    // As seen from its beginning.
    const double end_ms = std::max(0.0, free_in_ms + waited_ms) + run_ms;
    free_in_ms = end_ms - waited_ms;
    if (is_known && attempt.purpose != Purpose::kAudit && waited_ms >= settings_.slow_ms &&
        waited_ms > settings_.slow_factor * end_ms) {
      slow_.insert(id);
    }
    const bool is_begun = is_first || attempt.progress > 0 || attempt.shards_done > 0;
    const double still_ms = Ms(now - std::max(begin, attempt.progress_at)).count();
    const double patience_ms = std::max<double>(settings_.hung_ms, settings_.hung_factor * run_ms);
    if (is_begun && still_ms > patience_ms) {
      hung->push_back(id);
    }
  }
}

// Nobody was there to see the time pass: everything that lasts until some time, or counts from one,
// lasts and counts as if it had not.
void Queue::shift(std::chrono::milliseconds by) {
  leases_.clear();
  for (auto& [id, attempt] : attempts_) {
    attempt.lease_until += by;
    attempt.progress_at += by;
    attempt.active_at += attempt.active_at == Time{} ? by.zero() : by;
    leases_.emplace(attempt.lease_until, id);
  }
  for (auto& [id, worker] : workers_) {
    worker.seen_at += by;
  }
  for (auto& [order, job] : jobs_) {
    job.served_at += by;
    job.waiting_since += by;
    for (StageState& stage : job.stages) {
      stage.audits_possible_at += by;
      for (auto& [worker, backoff] : stage.backoffs) {
        backoff.until += by;
      }
      std::set<std::pair<Time, std::uint64_t>> retries;
      for (const auto& [retry_at, shard] : stage.retries) {
        retries.emplace(retry_at + by, shard);
      }
      stage.retries = std::move(retries);
      for (auto& [shard, trouble] : stage.troubles) {
        trouble.retry_at += by;
        for (LoneLoss& loss : trouble.lone_losses) {
          loss.at += by;
        }
      }
    }
  }
  for (auto& [work, dispute] : disputes_) {
    dispute.possible_at += by;
  }
  for (auto& [name, at] : passed_at_) {
    at += by;
  }
  for (auto& [id, lost] : lost_) {
    lost.at += by;
  }
  deaths_.shift(by);
}

}  // namespace weft::coordinator
