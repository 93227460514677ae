#include "coordinator/queue/explain_reasons.h"

#include <algorithm>
#include <utility>

namespace weft::coordinator {

namespace {

struct Words {
  const char* code;
  const char* text;  // what is so with the workers
  const char* mend;
};

Words words_of(Obstacle obstacle) {
  switch (obstacle) {
    case Obstacle::kLost:
      return {reason::kLost, "silent", "look whether the process and its network live"};
    case Obstacle::kFingerprint:
      return {reason::kOtherNumerics, "compute other numbers than those the job began with",
              "start workers on machines of the kind that the job began with"};
    case Obstacle::kLabels:
      return {reason::kLabels, "lack a label that the job asks for",
              "start a worker with the job's labels"};
    case Obstacle::kMemory:
      return {reason::kMemory, "have less memory than a run needs",
              "start a worker with more memory"};
    case Obstacle::kDrained:
      return {reason::kDrained, "are drained", "weft drain --undo NAME"};
    case Obstacle::kBlocked:
      return {reason::kBlocked,
              "are blocked for this kind of task: they failed what passed elsewhere",
              "mend the machine, then weft unblock NAME"};
    case Obstacle::kShort:
      return {reason::kBackingOff, "ran short of memory, disk or files and wait",
              "make room on the machine; no retry is used up"};
    case Obstacle::kFailing:
      return {reason::kFailing, "failed several times in a row and wait", "look at their logs"};
    case Obstacle::kMemoryHeld:
      return {reason::kMemoryHeld, "hold their memory for what they run", ""};
    case Obstacle::kWallTime:
      return {reason::kWallTime, "must end before a run would",
              "start a worker with more time left"};
    case Obstacle::kNone:
      break;
  }
  return {reason::kDue, "may run it", ""};
}

std::string names_of(const std::vector<const WorkerState*>& workers) {
  constexpr std::size_t kNamed = 4;
  std::string text;
  for (std::size_t i = 0; i < std::min(kNamed, workers.size()); ++i) {
    text += (i == 0 ? "" : ", ") + workers[i]->name;
  }
  if (workers.size() > kNamed) {
    text += " and " + std::to_string(workers.size() - kNamed) + " more";
  }
  return text;
}

std::int64_t to_ms_since_epoch(Time time) { return time.time_since_epoch().count(); }

void explain_done(const Queue& queue, const StageState& stage, std::uint64_t shard,
                  Reasons& reasons) {
  const std::string author = queue.author_name(stage.authors[shard]);
  if (stage.disputed.contains(shard)) {
    reasons.add(reason::kMismatch, "workers gave different results of it; others are asked",
                "let a worker of another name join, if there is none", stage, {});
  }
  if (stage.auditing.contains(shard) || stage.awaits_audit(shard)) {
    reasons.add(reason::kAwaitsAudit, "it is done, and a second worker is to confirm its result",
                "", stage, {});
  }
  reasons.add(reason::kDone, author.empty() ? "it is done" : "it is done, by " + author, "", stage,
              {});
}

void explain_trouble(const JobState& job, const ShardTrouble& trouble, const StageState& stage,
                     Time now, Reasons& reasons) {
  const std::string logs = "weft logs " + job.id + " shows what failed";
  if (trouble.failure_count() > 0) {
    const bool must_wait = now < trouble.retry_at;
    reasons.add(must_wait ? reason::kRetry : reason::kLeftToOthers,
                "it failed " + std::to_string(trouble.failure_count()) + " times on " +
                    std::to_string(trouble.failures.size()) + " workers (" + trouble.last_message +
                    ")" + (must_wait ? "" : "; workers on which it did not fail come first"),
                logs, stage, must_wait ? trouble.retry_at : Time{});
  }
  if (!trouble.lone_losses.empty()) {
    reasons.add(reason::kSuspect,
                std::to_string(trouble.lone_losses.size()) +
                    " workers were lost while they ran it alone; it comes last",
                logs, stage, {});
  }
}

}  // namespace

v1::Reason* Reasons::next() {
  return response_.reasons_size() < kReasonsLimit ? response_.add_reasons() : &spare_;
}

void Reasons::add(const char* code, const std::string& text, const std::string& mend, Time until) {
  v1::Reason& reason = *next();
  reason.set_code(code);
  reason.set_text(text);
  reason.set_mend(mend);
  reason.set_until_ms(to_ms_since_epoch(until));
}

void Reasons::add(const char* code, const std::string& text, const std::string& mend,
                  const StageState& stage, Time until) {
  v1::Reason& reason = *next();
  reason.set_code(code);
  reason.set_text(text);
  reason.set_mend(mend);
  reason.set_stage(to_string(stage.name));
  reason.set_until_ms(to_ms_since_epoch(until));
}

void Reasons::add_of_worker(const char* code, const std::string& text, const std::string& mend,
                            const WorkerState& worker, const std::string& stage) {
  v1::Reason& reason = *next();
  reason.set_code(code);
  reason.set_text(text);
  reason.set_mend(mend);
  reason.set_worker(worker.name);
  reason.set_stage(stage);
}

void Reasons::add_obstacle(Obstacle obstacle, const std::vector<const WorkerState*>& workers,
                           const JobState& job, const StageState* stage, Time until) {
  const Words words = words_of(obstacle);
  v1::Reason& reason = *next();
  reason.set_code(words.code);
  reason.set_text(names_of(workers) + ": " + words.text + " (job " + job.id + ")");
  reason.set_mend(words.mend);
  reason.set_worker(workers.size() == 1 ? workers.front()->name : "");
  reason.set_stage(stage == nullptr ? "" : to_string(stage->name));
  reason.set_until_ms(to_ms_since_epoch(until));
}

std::string Reasons::first_text() const { return empty() ? "" : response_.reasons(0).text(); }

std::string Reasons::first_code() const { return empty() ? "" : response_.reasons(0).code(); }

v1::ExplainResponse Reasons::answer(const std::string& subject, const std::string& verdict) && {
  response_.set_subject(subject);
  response_.set_verdict(verdict);
  return std::move(response_);
}

std::string shards_in_words(std::uint64_t count) {
  return std::to_string(count) + (count == 1 ? " shard" : " shards");
}

void explain_shard(const Queue& queue, const JobState& job, const StageState& stage,
                   std::uint64_t shard, Time now, Reasons& reasons) {
  switch (stage.shards[shard]) {
    case ShardState::kDone:
      explain_done(queue, stage, shard, reasons);
      return;
    case ShardState::kRunning:
      for (const std::uint64_t id : stage.attempts) {
        const Attempt& attempt = queue.attempts().at(id);
        if (shard >= attempt.first_shard && shard - attempt.first_shard < attempt.shards) {
          reasons.add(reason::kRunning,
                      "it runs on " + attempt.worker_name + " in attempt " + std::to_string(id) +
                          " (" + to_string(attempt.purpose) + ")",
                      "", stage, {});
        }
      }
      return;
    case ShardState::kElsewhere:
      reasons.add(reason::kRunsElsewhere,
                  "it is equal to work that runs for another job; that result will be used", "",
                  stage, {});
      return;
    case ShardState::kQuarantined:
      for (const Trouble& trouble : job.troubles) {
        if (trouble.stage == stage.name && trouble.shard == shard) {
          reasons.add(reason::kQuarantined, trouble.message,
                      "mend the cause, then weft retry " + job.id, stage, {});
        }
      }
      return;
    case ShardState::kPending:
      break;
  }
  const auto trouble = stage.troubles.find(shard);
  if (trouble != stage.troubles.end()) {
    explain_trouble(job, trouble->second, stage, now, reasons);
  }
  for (const ShardRanges& suspects : stage.suspects) {
    if (suspects.contains(shard)) {
      reasons.add(reason::kSuspect,
                  "it was with a worker that was lost: it comes after the others, in a short run",
                  "", stage, {});
    }
  }
}

}  // namespace weft::coordinator
