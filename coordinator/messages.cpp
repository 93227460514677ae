#include "coordinator/messages.h"

#include <algorithm>

#include "core/error.h"
#include "proto/limits.h"

namespace weft::coordinator {

namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

void check_count(std::uint64_t count, std::uint64_t limit, const char* field) {
  if (count > limit) {
    refuse(std::string(field) + " is " + std::to_string(count) + "; at most " +
           std::to_string(limit) + " are allowed");
  }
}

CompletionClaim completion_from(const v1::Completion& completion) {
  CompletionClaim claim;
  claim.job = completion.job_id();
  claim.attempt = completion.attempt();
  claim.token = completion.lease_token();
  claim.work_ms = completion.work_ms();
  for (const v1::ShardResult& result : completion.results()) {
    claim.results.push_back(
        {result.shard(), digest_from(result.digest(), "results.digest"), result.size_bytes()});
  }
  if (completion.has_error()) {
    const v1::TaskError& error = completion.error();
    if (error.kind() == v1::ERROR_KIND_UNSPECIFIED) {
      refuse("completions.error.kind is not set");
    }
    claim.failure = Failure{error.kind() == v1::ERROR_KIND_RESOURCE_SHORT, error.shard(),
                            error.message().substr(0, v1::kErrorTextLimitBytes)};
  }
  return claim;
}

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

void describe(const StageState& stage, v1::StageProgress* progress) {
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
    const double at = stage.rate.empty() ? 0 : stage.rate.back().shards;
    const double left = static_cast<double>(stage.shards.size()) - at;
    progress->set_seconds_left(rate > 0 ? left / rate : -1);
  }
}

}  // namespace

std::int64_t to_ms(Time time) { return time.time_since_epoch().count(); }

core::Digest digest_from(const std::string& bytes, const char* field) {
  const std::optional<core::Digest> digest = core::Digest::from_binary(bytes);
  if (!digest) {
    refuse(std::string(field) + " is " + std::to_string(bytes.size()) +
           " bytes long; a digest has 32");
  }
  return *digest;
}

void check_id(const std::string& id, const char* field) {
  const bool is_good =
      !id.empty() && id.size() <= v1::kIdLimit && std::all_of(id.begin(), id.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '_' || c == '-';
      });
  if (!is_good) {
    refuse(std::string(field) + " must be 1 to 64 characters of A-Z, a-z, 0-9, _ and -");
  }
}

ReportEvent report_from(const v1::SynchronizeRequest& request) {
  check_id(request.request_id(), "request_id");
  check_id(request.worker_id(), "worker_id");
  check_count(request.name().size(), v1::kNameLimitBytes, "the length of name");
  check_count(request.threads(), v1::kThreadsLimit, "threads");
  check_count(request.free_attempts(), v1::kFreeAttemptsLimit, "free_attempts");
  check_count(static_cast<std::uint64_t>(request.labels_size()), v1::kLabelsLimit, "labels");
  check_count(static_cast<std::uint64_t>(request.scenes_size()), v1::kScenesLimit, "scenes");
  check_count(static_cast<std::uint64_t>(request.completions_size()), v1::kCompletionLimit,
              "the number of completions");
  check_count(request.wait_ms(), v1::kWaitLimitMs, "wait_ms");
  if (request.threads() == 0) {
    refuse("threads is 0; a worker has at least one");
  }
  ReportEvent report;
  report.worker = request.worker_id();
  report.name = request.name();
  report.threads = request.threads();
  report.memory_bytes = request.memory_bytes();
  report.fingerprint = digest_from(request.fingerprint(), "fingerprint");
  report.free_attempts = request.leaving() ? 0 : request.free_attempts();
  report.leaving = request.leaving();
  report.labels.assign(request.labels().begin(), request.labels().end());
  report.wall_left_ms = request.wall_left_ms();
  for (const std::string& scene : request.scenes()) {
    report.scenes.push_back(digest_from(scene, "scenes"));
  }
  for (const v1::RunningAttempt& running : request.running()) {
    report.running.push_back({running.job_id(), running.attempt(), running.lease_token(),
                              running.shards_done(), running.progress(),
                              running.last_line().substr(0, v1::kLastLineLimitBytes)});
  }
  for (const v1::Completion& completion : request.completions()) {
    report.completions.push_back(completion_from(completion));
  }
  return report;
}

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
  for (const StageName name : all_stages()) {
    v1::StageProgress& progress = *message.add_stages();
    progress.set_name(to_string(name));
    progress.set_state(v1::STAGE_STATE_WAITING);
    progress.set_seconds_left(-1);
    for (const StageState& stage : job.stages) {
      if (stage.name == name) {
        progress.set_seconds_left(0);
        describe(stage, &progress);
      }
    }
  }
  return message;
}

v1::Worker message_of(const Queue& queue, const WorkerState& worker, Time now) {
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
  for (const auto& [id, attempt] : queue.attempts()) {
    if (attempt.worker != worker.id) {
      continue;
    }
    const JobState& job = *queue.job(attempt.job);
    v1::WorkerAttempt& entry = *message.add_attempts();
    entry.mutable_name()->set_job_id(attempt.job);
    entry.mutable_name()->set_attempt(id);
    entry.set_fabric(job.fabric);
    entry.set_stage(to_string(job.stages[attempt.stage].name));
    entry.set_first_shard(attempt.first_shard);
    entry.set_shards(attempt.shards);
    entry.set_shards_done(attempt.shards_done);
  }
  return message;
}

}  // namespace weft::coordinator
