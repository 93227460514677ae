#include <algorithm>
#include <string>
#include <unordered_map>

#include "coordinator/scheduler/messages.h"

// The coordinator's state as people see it.

namespace weft::coordinator {

namespace {

constexpr std::size_t kTroublesShown = 32;

v1::JobState state_of(JobPhase phase) {
  switch (phase) {
    case JobPhase::kQueued:
      return v1::JOB_STATE_QUEUED;
    case JobPhase::kRunning:
      return v1::JOB_STATE_RUNNING;
    case JobPhase::kCommitting:
      return v1::JOB_STATE_COMMITTING;
    case JobPhase::kSucceeded:
      return v1::JOB_STATE_SUCCEEDED;
    case JobPhase::kFailed:
      return v1::JOB_STATE_FAILED;
    case JobPhase::kCancelled:
      return v1::JOB_STATE_CANCELLED;
  }
  return v1::JOB_STATE_UNSPECIFIED;
}

v1::Trouble::Kind kind_of(Trouble::Kind kind) {
  switch (kind) {
    case Trouble::Kind::kQuarantined:
      return v1::Trouble::KIND_QUARANTINED;
    case Trouble::Kind::kKiller:
      return v1::Trouble::KIND_KILLER;
    case Trouble::Kind::kMismatch:
      return v1::Trouble::KIND_MISMATCH;
  }
  return v1::Trouble::KIND_UNSPECIFIED;
}

v1::Trouble message_of(const Trouble& trouble) {
  v1::Trouble message;
  message.set_kind(kind_of(trouble.kind));
  message.set_stage(to_string(trouble.stage));
  message.set_shard(trouble.shard);
  message.set_message(trouble.message);
  message.mutable_workers()->Assign(trouble.workers.begin(), trouble.workers.end());
  message.set_attempt(trouble.attempt);
  message.set_liar(trouble.liar);
  return message;
}

// The last line of the attempt that began last among those that have logged anything.
std::string last_line(const Queue& queue, const StageState& stage) {
  for (auto id = stage.attempts.rbegin(); id != stage.attempts.rend(); ++id) {
    const auto attempt = queue.attempts().find(*id);
    if (attempt != queue.attempts().end() && !attempt->second.last_line.empty()) {
      return attempt->second.last_line;
    }
  }
  return "";
}

void describe(const Queue& queue, const StageState& stage, v1::StageProgress* progress) {
  progress->set_state(stage.is_done() ? v1::STAGE_STATE_DONE : v1::STAGE_STATE_RUNNING);
  progress->set_shards(stage.shards.size());
  progress->set_shards_done(stage.done);
  progress->set_shards_cached(stage.cached);
  progress->set_shards_running(stage.running);
  progress->set_failures(stage.failures);
  progress->set_started_at_ms(to_ms(stage.started_at));
  progress->set_ended_at_ms(to_ms(stage.ended_at));
  if (!stage.is_done()) {
    const double rate = Queue::shards_per_second(stage);
    progress->set_shards_per_second(rate);
    const double at =
        stage.rate.empty() ? static_cast<double>(stage.done) : stage.rate.back().shards;
    const double left = static_cast<double>(stage.shards.size()) - at;
    progress->set_seconds_left(rate > 0 ? left / rate : -1);
    progress->set_fraction_done(at / static_cast<double>(stage.shards.size()));
    progress->set_last_line(last_line(queue, stage));
  } else {
    progress->set_fraction_done(1);
  }
}

}  // namespace

v1::Version message_of(const VersionRecord& version) {
  v1::Version message;
  message.set_fabric(version.fabric);
  message.set_number(version.number);
  message.set_content_digest(version.content_digest.binary());
  message.set_size_bytes(version.size_bytes);
  message.set_file(version.file);
  message.set_job_id(version.job);
  message.set_comment(version.comment);
  message.set_published_at_ms(version.published_at_ms);
  message.mutable_tags()->Assign(version.tags.begin(), version.tags.end());
  message.set_parent(version.parent);
  message.set_shared_bytes(version.shared_bytes);
  message.set_cached_shards(version.cached_shards);
  message.set_computed_shards(version.computed_shards);
  message.set_user(version.user);
  message.set_carried_over_from(version.carried_over_from);
  return message;
}

v1::HistoryEntry message_of(const HistoryRecord& step) {
  v1::HistoryEntry message;
  message.set_at_ms(step.at_ms);
  message.set_action(step.action);
  message.set_number(step.number);
  message.set_tag(step.tag);
  message.set_user(step.user);
  message.set_comment(step.comment);
  return message;
}

v1::Job message_of(const Queue& queue, const JobState& job, Time now) {
  v1::Job message;
  message.set_id(job.id);
  message.set_fabric(job.fabric);
  message.set_state(state_of(job.phase));
  message.set_error(job.error);
  message.set_waiting_for(queue.waiting_for(job, now));
  message.set_submitted_at_ms(to_ms(job.submitted_at));
  message.set_started_at_ms(to_ms(job.started_at));
  message.set_ended_at_ms(to_ms(job.ended_at));
  message.set_revision(job.revision);
  message.set_user(job.demands.user);
  message.set_priority(job.demands.priority);
  message.set_paused(job.is_paused);
  message.mutable_labels()->Assign(job.demands.labels.begin(), job.demands.labels.end());
  for (std::size_t i = 0; i < std::min(job.troubles.size(), kTroublesShown); ++i) {
    *message.add_troubles() = message_of(job.troubles[i]);
  }
  message.set_superseded_attempts(job.superseded_attempts);
  message.set_superseded_results_used(job.superseded_results_used);
  message.set_speculative_attempts(job.speculative_attempts);
  message.set_audited_shards(job.audited_shards);
  message.set_audits_given_up(job.audits_given_up);
  for (const StageName name : all_stages()) {
    v1::StageProgress& progress = *message.add_stages();
    progress.set_name(to_string(name));
    progress.set_state(v1::STAGE_STATE_WAITING);
    progress.set_seconds_left(-1);
    for (const StageState& stage : job.stages) {
      if (stage.name == name) {
        progress.set_seconds_left(0);
        describe(queue, stage, &progress);
      }
    }
  }
  return message;
}

v1::AttemptInfo message_of(const KeptAttempt& attempt) {
  v1::AttemptInfo message;
  message.mutable_name()->set_job_id(attempt.begin.job);
  message.mutable_name()->set_attempt(attempt.begin.attempt);
  message.set_stage(to_string(attempt.begin.stage));
  message.set_first_shard(attempt.begin.first_shard);
  message.set_shards(attempt.begin.shards);
  message.set_worker(attempt.begin.worker_name);
  message.set_purpose(to_string(attempt.begin.purpose));
  message.set_began_at_ms(attempt.begin.began_at_ms);
  message.set_outcome(attempt.end ? to_string(attempt.end->outcome) : "running");
  if (attempt.end) {
    message.set_message(attempt.end->message);
    message.set_ended_at_ms(attempt.end->ended_at_ms);
    message.set_shards_done(attempt.end->shards_done);
  }
  if (attempt.taken_up > 0) {
    message.set_taken_up(attempt.taken_up);
    message.set_taken_up_at_ms(attempt.taken_up_at_ms);
    message.set_earlier_outcome(to_string(attempt.earlier_outcome));
    message.set_earlier_ended_at_ms(attempt.earlier_ended_at_ms);
  }
  return message;
}

namespace {

v1::Worker without_attempts(const Queue& queue, const WorkerState& worker, Time now) {
  v1::Worker message;
  message.set_id(worker.id);
  message.set_name(worker.name);
  message.set_threads(worker.threads);
  message.set_memory_bytes(worker.memory_bytes);
  message.set_fingerprint(worker.fingerprint.binary());
  message.set_lost(!queue.is_live(worker, now));
  message.set_last_seen_at_ms(to_ms(worker.seen_at));
  message.set_shards_done(worker.shards_done);
  message.set_failures(worker.failures);
  message.set_drained(queue.is_drained(worker.name));
  for (const StageName stage : queue.blocked_stages(worker.name)) {
    message.add_blocked_stages(to_string(stage));
  }
  message.mutable_labels()->Assign(worker.labels.begin(), worker.labels.end());
  message.set_wall_left_ms(worker.wall_left_ms);
  message.set_superseded(worker.superseded);
  message.set_undelivered(worker.undelivered);
  return message;
}

v1::WorkerAttempt message_of(const Queue& queue, std::uint64_t id, const Attempt& attempt) {
  const JobState& job = *queue.job(attempt.job);
  v1::WorkerAttempt entry;
  entry.mutable_name()->set_job_id(attempt.job);
  entry.mutable_name()->set_attempt(id);
  entry.set_fabric(job.fabric);
  entry.set_stage(to_string(job.stages[attempt.stage].name));
  entry.set_first_shard(attempt.first_shard);
  entry.set_shards(attempt.shards);
  entry.set_shards_done(attempt.shards_done);
  entry.set_last_line(attempt.last_line);
  return entry;
}

}  // namespace

std::vector<v1::Worker> messages_of_workers(
    const Queue& queue, Time now, const std::function<bool(const WorkerState&)>& is_wanted) {
  std::vector<v1::Worker> messages;
  std::unordered_map<std::string, std::size_t> message_of_worker;
  for (const auto& [id, worker] : queue.workers()) {
    if (is_wanted(worker)) {
      message_of_worker.emplace(id, messages.size());
      messages.push_back(without_attempts(queue, worker, now));
    }
  }
  for (const auto& [id, attempt] : queue.attempts()) {
    const auto found = message_of_worker.find(attempt.worker);
    if (found != message_of_worker.end()) {
      *messages[found->second].add_attempts() = message_of(queue, id, attempt);
    }
  }
  return messages;
}

}  // namespace weft::coordinator
