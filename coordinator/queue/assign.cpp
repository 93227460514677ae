#include <algorithm>
#include <tuple>

#include "coordinator/queue/queue.h"
#include "core/check.h"

// Which job a worker works for next, and what it is given.

namespace weft::coordinator {

namespace {

// By how many runs a job may be ahead of its share when its scene is there already.
constexpr double kNearLead = 2;

}  // namespace

AssignAction Queue::describe(const Attempt& attempt) const {
  const JobState& job = *this->job(attempt.job);
  return {attempt.job,         job.stages[attempt.stage].name,
          attempt.id,          attempt.token,
          attempt.first_shard, attempt.shards,
          settings_.lease_ms,  attempt.purpose};
}

void Queue::assign(const ReportEvent& report, Time now, Actions& actions) {
  std::uint64_t held = 0;
  std::uint32_t free = report.free_attempts;
  // What the worker owns and did not list was in an answer that it never saw.
  for (const Attempt* const owned : attempts_of(report.worker)) {
    if (job(owned->job)->fingerprint != report.fingerprint) {
      // It was restored in a job that has been bound to workers of other numbers since.
      const Attempt ended =
          end_attempt(owned->id, Outcome::kStopped, "its worker has other numbers", now, actions);
      release(ended, ended.losses, now);
      actions.wake = true;
      continue;
    }
    ++held;
    const bool is_listed =
        std::any_of(report.running.begin(), report.running.end(),
                    [&](const RunningClaim& claim) { return claim.attempt == owned->id; });
    if (!is_listed) {
      actions.reply.assignments.push_back(describe(*owned));
      free -= free > 0 ? 1 : 0;
    }
  }
  const WorkerState& worker = workers_.at(report.worker);
  for (; free > 0; --free) {
    std::optional<Run> run = next_run(worker, held > 0, now);
    if (!run && held == 0) {
      run = second_run(worker, now);
    }
    if (!run) {
      return;
    }
    give(*run, worker, now, actions);
    ++held;
  }
}

void Queue::give(const Run& run, const WorkerState& worker, Time now, Actions& actions) {
  JobState& job = jobs_.at(run.job_order);
  StageState& stage = job.stages[run.stage];
  Attempt attempt;
  attempt.id = next_attempt_++;
  attempt.job = job.id;
  attempt.stage = run.stage;
  attempt.first_shard = run.first_shard;
  attempt.shards = run.shards;
  attempt.worker = worker.id;
  attempt.worker_name = worker.name;
  attempt.purpose = run.purpose;
  attempt.losses = run.losses;
  attempt.token = make_token(stage, run.first_shard, run.shards);
  const double threads = std::min<double>(worker.threads, static_cast<double>(run.shards));
  attempt.charged_ms = stage.shard_thread_ms > 0
                           ? stage.shard_thread_ms * static_cast<double>(run.shards)
                           : threads * settings_.unmeasured_run_ms;
  shares_.charge(job.demands.user, job.id, attempt.charged_ms);
  CHECK_GT(take_shards(attempt), 0U);
  job.speculative_attempts += run.purpose == Purpose::kSpeculation ? 1 : 0;
  job.started_at = job.started_at == Time{} ? now : job.started_at;
  job.phase = JobPhase::kRunning;
  job.waiting_since = now;
  ++job.revision;
  const Attempt& begun = begin_attempt(std::move(attempt), now);
  actions.attempts_begun.push_back(record_of(begun));
  actions.reply.assignments.push_back(describe(begun));
  refresh(job, now);
  if (stage.rate.empty()) {
    sample_rate(run.job_order, now);
  }
}

std::int64_t Queue::priority(const JobState& job, Time now) const {
  return job.demands.priority + (now - job.waiting_since).count() / settings_.ageing_ms;
}

// The jobs that have something for workers of this kind, whose turn it is first.
std::vector<std::uint64_t> Queue::order_for(const WorkerState& worker, Time now) const {
  struct Candidate {
    std::uint64_t order;
    std::int64_t priority;
    double of_user;
    double of_job;
    bool is_near;
  };
  std::vector<Candidate> candidates;
  std::map<std::int64_t, double> least_of_users;  // by priority
  std::map<std::pair<std::int64_t, std::string>, double> least_of_jobs;
  for (const std::uint64_t order : ready_) {
    const JobState& job = jobs_.at(order);
    if (job.fingerprint != worker.fingerprint) {
      continue;
    }
    const bool is_near =
        std::any_of(job.stages.begin(), job.stages.end(), [&](const StageState& stage) {
          return stage.pending() > 0 && stage.scene != core::Digest{} &&
                 std::find(worker.scenes.begin(), worker.scenes.end(), stage.scene) !=
                     worker.scenes.end();
        });
    const Candidate candidate{order, priority(job, now), shares_.of_user(job.demands.user),
                              shares_.of_job(job.demands.user, job.id), is_near};
    candidates.push_back(candidate);
    const auto of_users = least_of_users.emplace(candidate.priority, candidate.of_user).first;
    of_users->second = std::min(of_users->second, candidate.of_user);
    const auto of_jobs =
        least_of_jobs.emplace(std::pair(candidate.priority, job.demands.user), candidate.of_job)
            .first;
    of_jobs->second = std::min(of_jobs->second, candidate.of_job);
  }
  const double lead_ms = kNearLead * settings_.target_run_ms * worker.threads;
  for (Candidate& candidate : candidates) {
    const std::string& user = jobs_.at(candidate.order).demands.user;
    candidate.is_near = candidate.is_near &&
                        candidate.of_user <= least_of_users.at(candidate.priority) + lead_ms &&
                        candidate.of_job <= least_of_jobs.at({candidate.priority, user}) + lead_ms;
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tuple(-a.priority, !a.is_near, a.of_user, a.of_job, a.order) <
           std::tuple(-b.priority, !b.is_near, b.of_user, b.of_job, b.order);
  });
  std::vector<std::uint64_t> orders;
  for (const Candidate& candidate : candidates) {
    orders.push_back(candidate.order);
  }
  return orders;
}

std::optional<Queue::Run> Queue::next_run(const WorkerState& worker, bool is_busy, Time now) {
  if (ready_.empty() || drained_.contains(worker.name)) {
    return std::nullopt;
  }
  for (const std::uint64_t order : order_for(worker, now)) {
    const JobState& job = jobs_.at(order);
    for (std::size_t s = 0; s < job.stages.size(); ++s) {
      const StageState& stage = job.stages[s];
      const bool has_audits = !stage.audits.empty() || !stage.disputed.empty();
      if ((stage.pending() == 0 && !has_audits) ||
          hindrance(worker, job, stage, now).obstacle != Obstacle::kNone) {
        continue;
      }
      const std::uint64_t size =
          stage.pending() == 0 ? 0 : run_size(job, stage, worker, is_busy, now);
      std::optional<Run> run = size == 0 ? std::nullopt : pending_run(order, s, worker, size, now);
      if (!run && has_audits) {
        run = audit_run(order, s, worker, sized(stage, worker, 0, now));
      }
      if (run) {
        return run;
      }
    }
  }
  return std::nullopt;
}

}  // namespace weft::coordinator
