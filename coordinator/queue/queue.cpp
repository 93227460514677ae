#include "coordinator/queue/queue.h"

#include <algorithm>

#include "core/check.h"

// Jobs: submitted, planned, bound to workers of one kind, ended.

namespace weft::coordinator {

Queue::Queue(QueueSettings settings, std::uint32_t epoch)
    : settings_(settings), next_attempt_((static_cast<std::uint64_t>(epoch) << 32) + 1) {
  CHECK_GT(epoch, 0U);
}

Actions Queue::apply(const Event& event, Time now) {
  const std::chrono::milliseconds passed = now - last_event_at_;
  const std::chrono::milliseconds stall(settings_.stall_ms);
  if (last_event_at_ != Time{} && (passed > stall || passed < -stall)) {
    shift(passed);
  } else {
    now = std::max(now, last_event_at_);
  }
  last_event_at_ = now;
  Actions actions;
  std::visit([&](const auto& e) { on(e, now, actions); }, event);
  return actions;
}

const JobState* Queue::job(const std::string& id) const {
  const auto order = order_of_job_.find(id);
  return order == order_of_job_.end() ? nullptr : &jobs_.at(order->second);
}

JobState* Queue::find_job(const std::string& id) {
  const auto order = order_of_job_.find(id);
  return order == order_of_job_.end() ? nullptr : &jobs_.at(order->second);
}

std::vector<const JobState*> Queue::jobs() const {
  std::vector<const JobState*> jobs;
  for (const auto& [order, job] : jobs_) {
    jobs.push_back(&job);
  }
  return jobs;
}

std::size_t Queue::unfinished_jobs_of(const std::string& user) const {
  return static_cast<std::size_t>(std::count_if(jobs_.begin(), jobs_.end(), [&](const auto& entry) {
    return !entry.second.has_ended() && entry.second.demands.user == user;
  }));
}

void Queue::forget_job(const std::string& id) {
  const auto order = order_of_job_.find(id);
  CHECK(order != order_of_job_.end());
  CHECK(jobs_.at(order->second).has_ended());
  jobs_.erase(order->second);
  order_of_job_.erase(order);
}

std::vector<StageResults> Queue::finished_stages(const JobState& job) const {
  std::vector<StageResults> finished;
  for (const StageState& stage : job.stages) {
    if (stage.is_done()) {
      finished.push_back({stage.name, stage.results});
    }
  }
  return finished;
}

void Queue::on(const SubmitEvent& event, Time now, Actions& actions) {
  if (find_job(event.job) != nullptr) {
    return;  // the same submission again
  }
  const std::uint64_t order = next_order_++;
  order_of_job_[event.job] = order;
  JobState& job = jobs_[order];
  job.id = event.job;
  job.fabric = event.fabric;
  job.submitted_at = event.submitted_at;
  job.demands = event.demands;
  job.is_paused = event.is_paused;
  job.served_at = now;
  job.waiting_since = now;
  restore_mismatches(job, event.mismatches);
  if (event.fingerprint) {
    job.fingerprint = event.fingerprint;
    ask_for_plan(job, actions);
  }
  bind_jobs(now, actions);
}

void Queue::on(const CancelEvent& event, Time now, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job != nullptr && !job->has_ended()) {
    end_job(*job, JobPhase::kCancelled, now, actions);
  }
}

void Queue::on(const JobFailedEvent& event, Time now, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job != nullptr && !job->has_ended() && job->generation == event.generation) {
    job->error = event.error;
    end_job(*job, JobPhase::kFailed, now, actions);
  }
}

void Queue::on(const CommittedEvent& event, Time now, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job != nullptr && job->phase == JobPhase::kCommitting &&
      job->generation == event.generation) {
    end_job(*job, JobPhase::kSucceeded, now, actions);
  }
}

void Queue::on(const PlannedEvent& event, Time now, Actions& actions) {
  JobState* const job = find_job(event.job);
  if (job == nullptr || job->has_ended() || job->generation != event.generation) {
    return;
  }
  job->planning = false;
  ++job->revision;
  bool any_done = job->plan_again;
  for (const PlannedStage& planned : event.stages) {
    const bool is_known =
        std::any_of(job->stages.begin(), job->stages.end(),
                    [&](const StageState& stage) { return stage.name == planned.name; });
    if (!is_known) {
      add_stage(order_of_job_.at(job->id), *job, planned, now, actions);
      any_done = any_done || job->stages.back().is_done();
      actions.wake = true;
    }
  }
  if (any_done) {
    ask_for_plan(*job, actions);
  } else {
    job->is_planned = event.stages.empty();
  }
  refresh(*job, now);
  settle(*job, now, actions);
}

void Queue::on(const ResultLostEvent& event, Time now, Actions& actions) {
  for (auto& [order, job] : jobs_) {
    if (job.has_ended()) {
      continue;
    }
    bool uses_it = false;
    for (const StageState& stage : job.stages) {
      for (std::size_t i = 0; i < stage.shards.size() && !uses_it; ++i) {
        uses_it = stage.shards[i] == ShardState::kDone && stage.results[i] == event.result;
      }
    }
    if (uses_it && ++job.results_lost > settings_.reset_limit) {
      job.error =
          "results of this job were lost from the coordinator's disk again and again "
          "(last: " +
          event.result.hex() + "); check that disk, then submit the job again";
      end_job(job, JobPhase::kFailed, now, actions);
    } else if (uses_it) {
      begin_again(job, now, actions);
    }
  }
}

void Queue::on(const TickEvent& /*event*/, Time now, Actions& actions) {
  expire(now, actions);
  for (auto& [id, worker] : workers_) {
    count(worker, now);
  }
  bind_jobs(now, actions);
  watch(now, actions);
  look_after_audits(now, actions);
  const std::chrono::milliseconds memory(settings_.forget_worker_ms);
  std::erase_if(workers_, [&](const auto& entry) {
    return !is_live(entry.second, now) && now - entry.second.seen_at > memory;
  });
  std::erase_if(lost_, [&](const auto& entry) { return now - entry.second.at > memory; });
  std::erase_if(passed_at_, [&](const auto& entry) { return now - entry.second > 2 * memory; });
  deaths_.forget_before(now - memory);
}

void Queue::ask_for_plan(JobState& job, Actions& actions) {
  CHECK(job.fingerprint.has_value());
  if (job.planning) {
    job.plan_again = true;
    return;
  }
  job.planning = true;
  job.plan_again = false;
  actions.plan.push_back({job.id, job.generation, *job.fingerprint});
}

// What becomes of a job that has nothing to run any more, or too much that cannot run.
void Queue::settle(JobState& job, Time now, Actions& actions) {
  if (job.has_ended() || job.phase == JobPhase::kCommitting) {
    return;
  }
  const std::uint64_t quarantined = job.quarantined();
  const bool can_go_on =
      job.planning || std::any_of(job.stages.begin(), job.stages.end(), [](const StageState& s) {
        return s.done + s.quarantined < s.shards.size();
      });
  if (quarantined > 0 && (!can_go_on || quarantined >= settings_.quarantine_limit)) {
    std::uint64_t named = 0;
    for (const Trouble& trouble : job.troubles) {
      if (trouble.kind != Trouble::Kind::kMismatch && named < 3) {
        job.error += (named++ == 0 ? "" : "\n") + trouble.message;
      }
    }
    if (named < quarantined) {
      job.error += "\nand " + std::to_string(quarantined - named) + " more";
    }
    end_job(job, JobPhase::kFailed, now, actions);
  } else if (job.is_planned && quarantined == 0 && !can_go_on && job.unconfirmed() == 0) {
    job.phase = JobPhase::kCommitting;
    ++job.revision;
    actions.commit.push_back({job.id, job.generation});
  }
}

// Notes whether the job has something for a worker.
void Queue::refresh(JobState& job, Time now) {
  const bool is_ready =
      !job.has_ended() && !job.is_paused && job.phase != JobPhase::kCommitting &&
      std::any_of(job.stages.begin(), job.stages.end(), [](const StageState& stage) {
        return stage.pending() > 0 || !stage.audits.empty() || !stage.disputed.empty();
      });
  if (is_ready == job.is_ready) {
    return;
  }
  job.is_ready = is_ready;
  if (is_ready) {
    ready_.insert(order_of_job_.at(job.id));
    job.waiting_since = now;
    shares_.arrive(job.demands.user, job.id);
  } else {
    ready_.erase(order_of_job_.at(job.id));
  }
}

void Queue::end_job(JobState& job, JobPhase phase, Time now, Actions& actions) {
  job.phase = phase;
  job.ended_at = now;
  ++job.revision;
  drop_work(job, phase == JobPhase::kSucceeded ? Outcome::kSuperseded : Outcome::kStopped, now,
            actions);
  leave_disputes(job, actions);
  shares_.forget(job.demands.user, job.id);
  actions.ended.push_back(job.id);
  actions.wake = true;
}

// Takes all of the job's shards out of the queue; its attempts no longer own anything, and their
// workers are told so when they report next.
void Queue::drop_work(JobState& job, Outcome outcome, Time now, Actions& actions) {
  const auto order = static_cast<std::uint32_t>(order_of_job_.at(job.id));
  stop_attempts(job, outcome, "", now, actions);
  for (std::uint32_t s = 0; s < job.stages.size(); ++s) {
    StageState& stage = job.stages[s];
    for (std::uint64_t i = 0; i < stage.shards.size(); ++i) {
      if (stage.shards[i] != ShardState::kDone) {
        forget_ref(stage.digests[i], {i, order, s});
      }
      if (stage.shards[i] == ShardState::kElsewhere) {
        stage.shards[i] = ShardState::kPending;
      }
    }
    stage.elsewhere = 0;
    stage.fresh.clear();
    for (ShardRanges& suspects : stage.suspects) {
      suspects.clear();
    }
    stage.retries.clear();
    stage.deadly.clear();
    stage.audits.clear();
    stage.disputed.clear();
  }
  job.is_ready = false;
  ready_.erase(order);
}

void Queue::begin_again(JobState& job, Time now, Actions& actions) {
  drop_work(job, Outcome::kStopped, now, actions);
  job.stages.clear();
  ++job.generation;
  ++job.revision;
  job.phase = job.phase == JobPhase::kQueued ? JobPhase::kQueued : JobPhase::kRunning;
  job.planning = false;
  job.plan_again = false;
  job.is_planned = false;
  std::erase_if(job.troubles,
                [](const Trouble& trouble) { return trouble.kind != Trouble::Kind::kMismatch; });
  actions.wake = true;
  ask_for_plan(job, actions);
}

// A job uses results of one numerics fingerprint only: that of the workers which have the most
// threads when it begins. When those are gone for long and others are there, it begins again.
void Queue::bind_jobs(Time now, Actions& actions) {
  std::map<core::Digest, std::uint64_t> threads;
  for (const auto& [id, worker] : workers_) {
    if (is_live(worker, now)) {
      threads[worker.fingerprint] += worker.threads;
    }
  }
  if (threads.empty()) {
    return;
  }
  const core::Digest most =
      std::max_element(threads.begin(), threads.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      })->first;
  for (auto& [order, job] : jobs_) {
    if (job.has_ended() || job.phase == JobPhase::kCommitting) {
      continue;
    }
    if (!job.fingerprint) {
      job.fingerprint = most;
      actions.bound.push_back({job.id, most});
      ask_for_plan(job, actions);
    }
    if (threads.contains(*job.fingerprint)) {
      job.served_at = now;
    } else if (now - job.served_at > std::chrono::milliseconds(settings_.rebind_ms)) {
      job.fingerprint = most;
      job.served_at = now;
      actions.bound.push_back({job.id, most});
      begin_again(job, now, actions);
    }
  }
}

}  // namespace weft::coordinator
