#include "coordinator/queue/explain.h"

#include <algorithm>
#include <map>
#include <vector>

#include "coordinator/queue/explain_reasons.h"

namespace weft::coordinator {

namespace {

bool is_idle(const Queue& queue, const WorkerState& worker) {
  return queue.attempts_of(worker.id).empty();
}

// What keeps the workers from a stage that has something for them; whether it keeps all of them.
bool explain_workers(const Queue& queue, const JobState& job, const StageState& stage, Time now,
                     Reasons& reasons) {
  std::map<Obstacle, std::vector<const WorkerState*>> kept;
  std::map<Obstacle, Time> until;
  bool any_free = false;
  for (const auto& [id, worker] : queue.workers()) {
    const Hindrance hindrance = queue.hindrance(worker, job, stage, now);
    if (hindrance.obstacle == Obstacle::kNone) {
      any_free = true;
      continue;
    }
    kept[hindrance.obstacle].push_back(&worker);
    Time& soonest = until[hindrance.obstacle];
    soonest = soonest == Time{} ? hindrance.until : std::min(soonest, hindrance.until);
  }
  if (any_free) {
    return false;
  }
  for (const auto& [obstacle, workers] : kept) {
    if (obstacle != Obstacle::kLost) {
      reasons.add_obstacle(obstacle, workers, job, &stage, until.at(obstacle));
    }
  }
  return true;
}

void explain_pending(const Queue& queue, const JobState& job, const StageState& stage, Time now,
                     Reasons& reasons) {
  std::uint64_t waiting_for_retry = 0;
  Time soonest{};
  for (const auto& [retry_at, shard] : stage.retries) {
    if (retry_at > now) {
      ++waiting_for_retry;
      soonest = soonest == Time{} ? retry_at : soonest;
    }
  }
  const bool any_eligible = !queue.eligible(job, stage, now).empty();
  if (waiting_for_retry == stage.pending() && any_eligible) {
    reasons.add(reason::kRetry,
                shards_in_words(waiting_for_retry) + " of " + to_string(stage.name) +
                    " failed and will be tried again",
                "weft logs " + job.id + " shows what failed", stage, soonest);
    return;
  }
  const bool all_kept = explain_workers(queue, job, stage, now, reasons);
  const bool any_idle =
      std::any_of(queue.workers().begin(), queue.workers().end(), [&](const auto& entry) {
        return queue.hindrance(entry.second, job, stage, now).obstacle == Obstacle::kNone &&
               is_idle(queue, entry.second);
      });
  if (!all_kept && !any_idle) {
    reasons.add(reason::kWorkersBusy,
                shards_in_words(stage.pending()) + " of " + to_string(stage.name) +
                    " wait for a free worker; all that can run them are at work",
                "start more workers, or raise its priority (" +
                    std::to_string(queue.priority(job, now)) +
                    " now, its waiting included): weft priority " + job.id + " NUMBER",
                stage, {});
  }
}

void explain_audits(const Queue& queue, const JobState& job, const StageState& stage, Time now,
                    Reasons& reasons) {
  const std::set<std::string> names = queue.eligible(job, stage, now);
  const auto patience = std::chrono::milliseconds(queue.settings().rebind_ms);
  for (const std::uint64_t shard : stage.disputed) {
    const Dispute& dispute = queue.disputes().at(stage.digests[shard]);
    const bool runs = dispute.attempt != 0;
    reasons.add(reason::kMismatch,
                std::string(to_string(stage.name)) + " shard " + std::to_string(shard) + " has " +
                    std::to_string(dispute.opinions.size()) + " results that differ; " +
                    (runs ? "a further worker computes it" : "a further worker is to compute it"),
                "let a worker of another name join, if there is none", stage,
                runs ? Time{} : dispute.possible_at + patience);
  }
  const std::uint64_t waiting = stage.unconfirmed() - stage.disputed.size();
  if (waiting > 0) {
    const bool is_possible = names.size() > 1 || stage.audits.empty();
    reasons.add(reason::kAwaitsAudit,
                shards_in_words(waiting) + " of " + to_string(stage.name) +
                    " wait for a second worker to confirm their results" +
                    (is_possible ? "" : ", and there is no worker of another name"),
                is_possible ? ""
                            : "start a worker under another name; without one these audits "
                              "are given up",
                stage, is_possible ? Time{} : stage.audits_possible_at + patience);
  }
}

void explain_stage(const Queue& queue, const JobState& job, const StageState& stage, Time now,
                   Reasons& reasons) {
  if (stage.pending() > 0) {
    explain_pending(queue, job, stage, now, reasons);
  }
  if (stage.elsewhere > 0) {
    reasons.add(reason::kRunsElsewhere,
                shards_in_words(stage.elsewhere) + " of " + to_string(stage.name) +
                    " are equal to work that runs for another job; its results will be used",
                "", stage, {});
  }
  explain_audits(queue, job, stage, now, reasons);
}

std::string running_in_words(const Queue& queue, const JobState& job) {
  std::set<std::string> workers;
  std::uint64_t shards = 0;
  std::string stages;
  for (const StageState& stage : job.stages) {
    shards += stage.running;
    for (const std::uint64_t id : stage.attempts) {
      workers.insert(queue.attempts().at(id).worker_name);
    }
    if (!stage.attempts.empty()) {
      stages += (stages.empty() ? "" : ", ") + std::string(to_string(stage.name));
    }
  }
  if (workers.empty()) {
    return "";
  }
  return "runs " + shards_in_words(shards) + " of " + stages + " on " +
         std::to_string(workers.size()) + (workers.size() == 1 ? " worker" : " workers");
}

// What holds an unfinished job back though it is not paused.
void explain_waiting(const Queue& queue, const JobState& job, Time now, Reasons& reasons) {
  const auto live = [&](const auto& entry) { return queue.is_live(entry.second, now); };
  const auto& workers = queue.workers();
  if (std::none_of(workers.begin(), workers.end(), live)) {
    reasons.add(reason::kNoWorker, "a worker: none is connected",
                "start one: weft-worker, or weft up");
    return;
  }
  const bool any_alike = std::any_of(workers.begin(), workers.end(), [&](const auto& entry) {
    return queue.is_live(entry.second, now) && entry.second.fingerprint == job.fingerprint;
  });
  if (job.fingerprint && !any_alike) {
    reasons.add(reason::kOtherNumerics,
                "a worker whose numbers are equal to those the job began with (fingerprint " +
                    job.fingerprint->hex().substr(0, 12) + ")",
                "bring one of those workers back, or wait: the job then begins again with the "
                "workers that are there",
                job.served_at + std::chrono::milliseconds(queue.settings().rebind_ms));
    return;
  }
  if (job.planning) {
    reasons.add(reason::kPlanning, "its next stages are being planned", "");
  }
  for (const StageState& stage : job.stages) {
    explain_stage(queue, job, stage, now, reasons);
  }
}

// Whether explain_audits says of this mismatch whom it waits for.
bool is_asked(const JobState& job, const Trouble& mismatch) {
  return std::any_of(job.stages.begin(), job.stages.end(), [&](const StageState& stage) {
    return stage.name == mismatch.stage && stage.disputed.contains(mismatch.shard);
  });
}

void explain_troubles(const JobState& job, Reasons& reasons) {
  for (const Trouble& trouble : job.troubles) {
    if (trouble.kind == Trouble::Kind::kMismatch) {
      if (!is_asked(job, trouble)) {
        reasons.add(
            reason::kMismatch, trouble.message,
            trouble.liar.empty() ? "" : "mend the machine, then weft unblock " + trouble.liar);
      }
      continue;
    }
    reasons.add(reason::kQuarantined, trouble.message,
                "weft logs " + job.id + " --task " + to_string(trouble.stage) + "/" +
                    std::to_string(trouble.shard) + "; mend it, then weft retry " + job.id);
  }
  if (job.audits_given_up > 0) {
    reasons.add(reason::kAuditsGivenUp,
                "results of " + shards_in_words(job.audits_given_up) +
                    " were not confirmed: no second worker could do it",
                "let workers of two names at least join");
  }
}

std::string phase_in_words(const JobState& job) {
  switch (job.phase) {
    case JobPhase::kCommitting:
      return "all results are there; the database is being assembled and published";
    case JobPhase::kSucceeded:
      return "succeeded";
    case JobPhase::kFailed:
      return "failed: " + job.error;
    case JobPhase::kCancelled:
      return "was cancelled";
    case JobPhase::kQueued:
    case JobPhase::kRunning:
      break;
  }
  return "";
}

}  // namespace

v1::ExplainResponse explain_job(const Queue& queue, const JobState& job, Time now) {
  Reasons reasons;
  const std::string phase = phase_in_words(job);
  if (!phase.empty()) {
    reasons.add(job.has_ended() ? reason::kEnded : reason::kCommitting, phase,
                job.phase == JobPhase::kFailed || job.phase == JobPhase::kCancelled
                    ? "weft retry " + job.id + " goes on with the results that are there"
                    : "");
    explain_troubles(job, reasons);
    return std::move(reasons).answer("job " + job.id, phase);
  }
  if (job.is_paused) {
    reasons.add(reason::kPaused, "it is paused", "weft resume " + job.id);
    explain_troubles(job, reasons);
    return std::move(reasons).answer("job " + job.id, "is paused");
  }
  const std::string running = running_in_words(queue, job);
  if (!running.empty()) {
    reasons.add(reason::kRunning, running, "");
  }
  explain_waiting(queue, job, now, reasons);
  if (reasons.empty()) {
    reasons.add(reason::kDue, "a worker gets it with its next report", "");
  }
  const std::string verdict = running.empty() ? "waits: " + reasons.first_text() : running;
  explain_troubles(job, reasons);
  return std::move(reasons).answer("job " + job.id, verdict);
}

std::string Queue::waiting_for(const JobState& job, Time now) const {
  const bool moves = job.has_ended() || job.phase == JobPhase::kCommitting ||
                     std::any_of(job.stages.begin(), job.stages.end(),
                                 [](const StageState& stage) { return !stage.attempts.empty(); });
  if (moves) {
    return "";
  }
  if (job.is_paused) {
    return "weft resume " + job.id + " (it is paused)";
  }
  Reasons reasons;
  explain_waiting(*this, job, now, reasons);
  return reasons.empty() || reasons.first_code() == reason::kPlanning ? "" : reasons.first_text();
}

v1::ExplainResponse explain_task(const Queue& queue, const JobState& job,
                                 const std::string& stage_name, std::uint64_t shard, Time now) {
  Reasons reasons;
  const std::string subject = "task " + job.id + " " + stage_name + " " + std::to_string(shard);
  const auto found =
      std::find_if(job.stages.begin(), job.stages.end(),
                   [&](const StageState& stage) { return to_string(stage.name) == stage_name; });
  if (found == job.stages.end() || shard >= found->shards.size()) {
    const bool has_ended = job.has_ended();
    const std::string text = found != job.stages.end()
                                 ? "there is no such shard: " + stage_name + " has " +
                                       std::to_string(found->shards.size())
                             : has_ended ? "its job ended before it was planned"
                                         : "its stage waits for the results of earlier stages";
    reasons.add(has_ended ? reason::kEnded : reason::kWaitsForStage, text,
                has_ended ? "" : "weft explain job " + job.id);
    return std::move(reasons).answer(subject, text);
  }
  explain_shard(queue, job, *found, shard, now, reasons);
  const bool is_pending = found->shards[shard] == ShardState::kPending;
  if (is_pending && job.has_ended()) {
    reasons.add(reason::kEnded, "its job " + phase_in_words(job), "weft retry " + job.id);
  } else if (is_pending && job.is_paused) {
    reasons.add(reason::kPaused, "its job is paused", "weft resume " + job.id);
  } else if (is_pending) {
    explain_workers(queue, job, *found, now, reasons);
    if (reasons.empty()) {
      explain_waiting(queue, job, now, reasons);
    }
    if (reasons.empty()) {
      reasons.add(reason::kDue, "a worker gets it in its turn", "");
    }
  }
  const std::string verdict = (is_pending ? "waits: " : "") + reasons.first_text();
  return std::move(reasons).answer(subject, verdict);
}

v1::ExplainResponse explain_worker(const Queue& queue, const WorkerState& worker, Time now) {
  Reasons reasons;
  const std::vector<const Attempt*> attempts = queue.attempts_of(worker.id);
  if (!queue.is_live(worker, now)) {
    reasons.add_of_worker(reason::kLost, "it fell silent; what it ran is given to others",
                          "look whether the process and its network live", worker);
  }
  if (queue.is_drained(worker.name)) {
    reasons.add_of_worker(reason::kDrained, "it is drained: it gets nothing new",
                          "weft drain --undo " + worker.name, worker);
  }
  if (!worker.undelivered.empty()) {
    reasons.add_of_worker(reason::kBackingOff,
                          "it has results that it cannot deliver, keeps them and takes nothing "
                          "more: " +
                              worker.undelivered,
                          "make room where the coordinator keeps its state; nothing is computed "
                          "again",
                          worker);
  }
  for (const StageName stage : queue.blocked_stages(worker.name)) {
    const bool is_liar = queue.is_liar(worker.name, stage);
    reasons.add_of_worker(
        reason::kBlocked,
        std::string("it is blocked for ") + to_string(stage) + ": " +
            (is_liar ? "it gave wrong results" : "tasks failed here that passed elsewhere"),
        "mend the machine, then weft unblock " + worker.name, worker, to_string(stage));
  }
  for (const Attempt* const attempt : attempts) {
    const JobState& job = *queue.job(attempt->job);
    const std::string stage = to_string(job.stages[attempt->stage].name);
    reasons.add_of_worker(reason::kRunning,
                          "it runs " + shards_in_words(attempt->shards) + " of " + stage +
                              " of job " + job.id + " (" + to_string(attempt->purpose) + "), " +
                              std::to_string(attempt->shards_done) + " done",
                          "", worker, stage);
  }
  bool any_work = false;
  bool any_due = false;
  for (const JobState* const job : queue.jobs()) {
    for (const StageState& stage : job->stages) {
      if (!job->is_ready || stage.pending() + stage.unconfirmed() == 0) {
        continue;
      }
      any_work = true;
      const Hindrance hindrance = queue.hindrance(worker, *job, stage, now);
      const bool is_new = hindrance.obstacle != Obstacle::kLost &&
                          hindrance.obstacle != Obstacle::kDrained &&
                          hindrance.obstacle != Obstacle::kBlocked;
      any_due = any_due || hindrance.obstacle == Obstacle::kNone;
      if (hindrance.obstacle != Obstacle::kNone && is_new) {
        reasons.add_obstacle(hindrance.obstacle, {&worker}, *job, &stage, hindrance.until);
      }
    }
  }
  if (!any_work && attempts.empty()) {
    reasons.add_of_worker(reason::kNoWork, "no job has anything to run now", "", worker);
  } else if (any_due && attempts.empty()) {
    reasons.add_of_worker(reason::kDue, "it gets work with its next report", "", worker);
  }
  const bool runs = !attempts.empty();
  const std::string verdict =
      runs ? "runs " + std::to_string(attempts.size()) +
                 (attempts.size() == 1 ? " attempt" : " attempts")
           : "has nothing to do: " + (reasons.empty() ? std::string() : reasons.first_text());
  return std::move(reasons).answer("worker " + worker.name + " (" + worker.id + ")", verdict);
}

}  // namespace weft::coordinator
