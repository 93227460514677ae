#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/queue/queue.h"
#include "core/digest.h"

namespace weft::coordinator {

// A queue with a planner, a committer and a cache of results around it, in one thread and virtual
// time: what the coordinator's service is to the real one.
class QueueCluster {
 public:
  using Ms = std::chrono::milliseconds;

  explicit QueueCluster(QueueSettings queue_settings = {}, std::uint32_t first_epoch = 1)
      : queue(queue_settings, first_epoch), settings_(queue_settings), epoch_(first_epoch) {}

  // A job of stages with so many shards each; `content` tells equal work from different work.
  void submit(const std::string& job, std::vector<std::uint64_t> shards,
              const std::string& content = "", std::optional<core::Digest> fingerprint = {},
              const JobDemands& demands = {}) {
    plans_[job] = {std::move(shards), content.empty() ? job : content};
    submitted_.push_back({job, "fabric", fingerprint, now, demands, false, {}});
    apply(submitted_.back());
  }
  void submit_for(const std::string& user, const std::string& job,
                  std::vector<std::uint64_t> shards, std::int32_t priority = 0) {
    JobDemands demands;
    demands.user = user;
    demands.priority = priority;
    submit(job, std::move(shards), "", {}, demands);
  }
  void submit_audited(const std::string& job, std::vector<std::uint64_t> shards, double audit) {
    JobDemands demands;
    demands.audit = audit;
    submit(job, std::move(shards), "", {}, demands);
  }

  // The coordinator is killed and started again with what its journal has.
  void restart() {
    queue = Queue(settings_, ++epoch_);
    prior_attempts = open_attempts;
    for (const auto& [worker, is_liar] : blocked) {
      apply(BlockEvent{worker.first, worker.second, true, is_liar});
    }
    std::vector<SubmitEvent> jobs = submitted_;
    for (SubmitEvent& job : jobs) {
      if (std::find(ended.begin(), ended.end(), job.job) == ended.end()) {
        job.mismatches = mismatches_of(job.job);
        apply(job);
      }
    }
    prior_attempts.clear();
  }

  // As the journal has them: one without a liar is replaced by the next of its shard.
  [[nodiscard]] std::vector<MismatchRecord> mismatches_of(const std::string& job) const {
    std::vector<MismatchRecord> kept;
    for (const MismatchRecord& found : mismatches) {
      if (found.job == job) {
        std::erase_if(kept, [&](const MismatchRecord& open) {
          return open.stage == found.stage && open.shard == found.shard && open.liar.empty();
        });
        kept.push_back(found);
      }
    }
    return kept;
  }

  // What a shard's work is called and what its result is.
  static core::Digest work(const std::string& content, std::uint64_t stage, std::uint64_t shard,
                           const core::Digest& fingerprint = {}) {
    return core::digest_of(content + "/" + std::to_string(stage) + "/" + std::to_string(shard) +
                           "/" + fingerprint.hex());
  }
  static core::Digest result_of(const core::Digest& work) { return core::digest_of(work.hex()); }

  Actions apply(const Event& event) {
    Actions actions = queue.apply(event, now);
    record(actions);
    if (!hold_plans) {
      for (const PlanAction& plan : actions.plan) {
        answer(plan);
      }
      for (const CommitAction& commit : actions.commit) {
        apply(CommittedEvent{commit.job, commit.generation});
      }
    } else {
      held_plans.insert(held_plans.end(), actions.plan.begin(), actions.plan.end());
    }
    return actions;
  }

  void answer(const PlanAction& plan) {
    const JobState* const job = queue.job(plan.job);
    if (job == nullptr) {
      return;
    }
    const auto& [shards, content] = plans_.at(plan.job);
    const std::size_t done = queue.finished_stages(*job).size();
    PlannedEvent event{plan.job, plan.generation, {}};
    if (done < shards.size()) {
      PlannedStage stage;
      stage.name = all_stages()[done];
      for (std::uint64_t i = 0; i < shards[done]; ++i) {
        stage.digests.push_back(work(content, done, i, plan.fingerprint));
        const auto known = cache.find(stage.digests.back());
        if (known != cache.end()) {
          const core::Digest& work_digest = stage.digests.back();
          const auto author = authors.find(work_digest);
          stage.known.push_back({i, known->second,
                                 author == authors.end() ? std::string() : author->second,
                                 audited.contains(work_digest)});
        }
      }
      for (const FailureRecord& failure : failures) {
        if (failure.job == plan.job && failure.stage == stage.name) {
          stage.failures.push_back({failure.kind, failure.shard, failure.worker, failure.message});
        }
      }
      for (const auto& [id, attempt] : prior_attempts) {
        if (attempt.job == plan.job && attempt.stage == stage.name) {
          stage.attempts.push_back({id, attempt.first_shard, attempt.shards, attempt.worker,
                                    attempt.worker_name, attempt.purpose});
        }
      }
      event.stages.push_back(std::move(stage));
    }
    apply(event);
  }

  void advance(std::uint64_t ms) {
    constexpr std::uint64_t kTickMs = 5'000;
    for (; ms > kTickMs; ms -= kTickMs) {
      now += Ms(kTickMs);
      apply(TickEvent{});
    }
    now += Ms(ms);
    apply(TickEvent{});
  }

  const JobState& job(const std::string& id) const { return *queue.job(id); }

  Queue queue;
  Time now{std::chrono::hours(1)};
  bool hold_plans = false;
  std::vector<PlanAction> held_plans;
  // As a journal has them.
  std::map<core::Digest, core::Digest> cache;
  std::map<core::Digest, std::string> authors;
  std::set<core::Digest> audited;
  std::vector<FailureRecord> failures;
  std::map<std::pair<std::string, StageName>, bool> blocked;
  std::vector<MismatchRecord> mismatches;
  std::map<core::Digest, int> results_recorded;
  std::vector<std::string> ended;
  std::uint64_t attempts_begun = 0;
  // What runs, how it ended, and what ran before a restart.
  std::map<std::uint64_t, AttemptRecord> open_attempts;
  std::map<std::uint64_t, Outcome> outcomes;
  std::map<std::uint64_t, AttemptRecord> prior_attempts;

 private:
  void record(const Actions& actions) {
    for (const ResultDropRecord& dropped : actions.results_dropped) {
      const auto known = cache.find(dropped.shard);
      if (known != cache.end() && known->second == dropped.result) {
        cache.erase(known);
        results_recorded.erase(dropped.shard);
      }
    }
    for (const ResultRecord& record : actions.results) {
      results_recorded[record.shard] += 1;
      cache[record.shard] = record.result;
      authors[record.shard] = record.worker;
    }
    for (const AuditRecord& audit : actions.audits) {
      audited.insert(audit.shard);
    }
    failures.insert(failures.end(), actions.failures.begin(), actions.failures.end());
    for (const FailuresDropRecord& dropped : actions.failures_dropped) {
      std::erase_if(failures, [&](const FailureRecord& failure) {
        return failure.job == dropped.job && failure.stage == dropped.stage &&
               failure.worker == dropped.worker;
      });
    }
    for (const BlockRecord& block : actions.blocks) {
      blocked.erase({block.worker, block.stage});
      if (block.is_blocked) {
        blocked[{block.worker, block.stage}] = block.is_liar;
      }
    }
    mismatches.insert(mismatches.end(), actions.mismatches.begin(), actions.mismatches.end());
    for (const BindRecord& bound : actions.bound) {
      for (SubmitEvent& job : submitted_) {
        job.fingerprint = job.job == bound.job ? bound.fingerprint : job.fingerprint;
      }
    }
    for (const AttemptRecord& begun : actions.attempts_begun) {
      open_attempts[begun.attempt] = begun;
      ++attempts_begun;
    }
    for (const AttemptEndRecord& end : actions.attempts_ended) {
      open_attempts.erase(end.attempt);
      outcomes[end.attempt] = end.outcome;
    }
    ended.insert(ended.end(), actions.ended.begin(), actions.ended.end());
  }

  QueueSettings settings_;
  std::uint32_t epoch_;
  std::vector<SubmitEvent> submitted_;
  std::map<std::string, std::pair<std::vector<std::uint64_t>, std::string>> plans_;
};

// A worker that does what cluster.proto asks of it; the test says when what ends.
class QueueWorker {
 public:
  QueueWorker(QueueCluster& cluster, std::string id, std::uint32_t threads = 2,
              const std::string& name = "")
      : cluster_(cluster) {
    report_.name = name.empty() ? id : name;
    report_.worker = std::move(id);
    report_.threads = threads;
  }
  // What it says of itself, for tests that change it.
  ReportEvent& says() { return report_; }

  void set_fingerprint(const core::Digest& fingerprint) { report_.fingerprint = fingerprint; }

  // Reports all that it holds, asks for up to `free` attempts, and takes what it is given. Returns
  // the first answer; where that is all about the past, the worker calls again at once.
  Reply sync(std::uint32_t free = 0) {
    const Reply reply = send(free);
    receive(reply);
    if (free > 0 && reply.assignments.empty() && !reply.acknowledged.empty()) {
      receive(send(free));
    }
    return reply;
  }

  // The two halves of sync: an answer may be lost in between.
  Reply send(std::uint32_t free) {
    report_.free_attempts = free;
    const Reply reply = cluster_.apply(report_).reply;
    const bool has_news =
        !reply.assignments.empty() || !reply.stop.empty() || !reply.acknowledged.empty();
    // A call that waits is looked at again when something may have changed.
    return has_news ? reply : cluster_.apply(report_).reply;
  }
  void receive(const Reply& reply) {
    for (const AssignAction& assign : reply.assignments) {
      if (!holds(assign.attempt)) {
        held.push_back(assign);
        report_.running.push_back({assign.job, assign.attempt, assign.token, 0, 0, {}});
      }
    }
    for (const AttemptName& name : reply.acknowledged) {
      std::erase_if(report_.completions,
                    [&](const CompletionClaim& claim) { return claim.attempt == name.attempt; });
    }
    for (const AttemptName& name : reply.stop) {
      forget(name.attempt);
    }
  }

  // Ends its oldest attempt with the first `count` results (all: the default) after `work_ms`.
  // `lie`: with results that nobody else gives.
  CompletionClaim& finish(std::uint64_t work_ms = 1000, std::uint64_t count = ~std::uint64_t{0},
                          const std::string& lie = "") {
    const AssignAction assign = held.front();
    CompletionClaim claim{assign.job, assign.attempt, assign.token, {}, {}, work_ms};
    const JobState* const job = cluster_.queue.job(assign.job);
    for (std::uint64_t i = 0; job != nullptr && i < std::min(count, assign.shards); ++i) {
      for (const StageState& stage : job->stages) {
        if (stage.name == assign.stage && assign.first_shard + i < stage.shards.size()) {
          const std::uint64_t shard = assign.first_shard + i;
          const core::Digest right = QueueCluster::result_of(stage.digests[shard]);
          claim.results.push_back(
              {shard, lie.empty() ? right : core::digest_of(right.hex() + lie), 1});
        }
      }
    }
    forget(assign.attempt);
    report_.completions.push_back(std::move(claim));
    return report_.completions.back();
  }
  void fail(const std::string& message, bool resource_short = false) {
    const std::uint64_t shard = held.front().first_shard;
    finish(1000, 0).failure = Failure{resource_short, shard, message};
  }
  void leave() {
    report_.leaving = true;
    sync();
  }
  [[nodiscard]] bool holds(std::uint64_t attempt) const {
    for (const AssignAction& assign : held) {
      if (assign.attempt == attempt) {
        return true;
      }
    }
    return false;
  }
  [[nodiscard]] bool has_unacknowledged() const { return !report_.completions.empty(); }

  std::vector<AssignAction> held;

 private:
  void forget(std::uint64_t attempt) {
    std::erase_if(held, [&](const AssignAction& assign) { return assign.attempt == attempt; });
    std::erase_if(report_.running,
                  [&](const RunningClaim& claim) { return claim.attempt == attempt; });
  }

  QueueCluster& cluster_;
  ReportEvent report_;
};

}  // namespace weft::coordinator
