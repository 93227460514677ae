#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "coordinator/queue_events.h"
#include "coordinator/queue_state.h"

namespace weft::coordinator {

// The scheduler as a pure state machine: no I/O, no clock, no threads, no chance. What apply() does
// depends on the events so far and their times alone. A copy is a snapshot.
//
// - A shard is pending, running in one attempt, or done. Done is for ever, unless its result is
//   lost. Shards of equal digest, in whatever jobs, are done together, and only one of them runs.
// - An attempt is owned by the worker that was given it, for as long as its lease lasts; each
//   report that lists it renews the lease. Only the owner, with the lease's token, can fail an
//   attempt or free its shards. A success is taken from anybody while its shard is unfinished.
// - Work goes to workers in the order of the jobs' submission, then of the stages.
class Queue {
 public:
  // `epoch` counts the coordinator's starts: attempts of different epochs never have the same
  // number. REQUIRES: epoch > 0.
  explicit Queue(QueueSettings settings, std::uint32_t epoch);

  [[nodiscard]] Actions apply(const Event& event, Time now);

  // Nothing when there is no such job. Ended jobs stay until forget_job.
  [[nodiscard]] const JobState* job(const std::string& id) const;
  [[nodiscard]] std::vector<const JobState*> jobs() const;  // in the order of submission
  void forget_job(const std::string& id);                   // REQUIRES: it has ended

  [[nodiscard]] const std::map<std::string, WorkerState>& workers() const { return workers_; }
  [[nodiscard]] const std::map<std::uint64_t, Attempt>& attempts() const { return attempts_; }
  // Those of one worker, the oldest first.
  [[nodiscard]] std::vector<const Attempt*> attempts_of(const std::string& worker_id) const;
  [[nodiscard]] bool is_drained(const std::string& worker_name) const;
  [[nodiscard]] std::vector<StageName> blocked_stages(const std::string& worker_name) const;
  [[nodiscard]] bool is_live(const WorkerState& worker, Time now) const;
  [[nodiscard]] const QueueSettings& settings() const { return settings_; }

  // What plan() and commit() read: the stages that are done, in the order they were planned.
  [[nodiscard]] std::vector<StageResults> finished_stages(const JobState& job) const;

  // Shards per second over the last minute; 0 when unknown.
  [[nodiscard]] static double shards_per_second(const StageState& stage);
  // What an unfinished job lacks; empty when it moves.
  [[nodiscard]] std::string waiting_for(const JobState& job, Time now) const;

 private:
  struct ShardRef {
    std::uint64_t job_order = 0;
    std::size_t stage = 0;
    std::uint64_t shard = 0;
    bool operator==(const ShardRef&) const = default;
  };

  // What a lease token says, so that an attempt of an earlier epoch can be recognised.
  struct TokenClaim {
    StageName stage = StageName::kGeometry;
    std::uint64_t first_shard = 0;
    std::uint64_t shards = 0;
    core::Digest run;  // over the digests of its shards
  };
  enum class Recognised : std::uint8_t { kNo, kNotYet, kYes };

  void on(const SubmitEvent& event, Time now, Actions& actions);
  void on(const CancelEvent& event, Time now, Actions& actions);
  void on(const PauseEvent& event, Time now, Actions& actions);
  void on(const PriorityEvent& event, Time now, Actions& actions);
  void on(const DrainEvent& event, Time now, Actions& actions);
  void on(const BlockEvent& event, Time now, Actions& actions);
  void on(const DisconnectEvent& event, Time now, Actions& actions);
  void on(const PlannedEvent& event, Time now, Actions& actions);
  void on(const JobFailedEvent& event, Time now, Actions& actions);
  void on(const CommittedEvent& event, Time now, Actions& actions);
  void on(const ResultLostEvent& event, Time now, Actions& actions);
  void on(const ReportEvent& event, Time now, Actions& actions);
  void on(const TickEvent& event, Time now, Actions& actions);

  // jobs (queue.cpp)
  JobState* find_job(const std::string& id);
  void ask_for_plan(JobState& job, Actions& actions);
  void add_stage(std::uint64_t order, JobState& job, const PlannedStage& planned, Time now,
                 Actions& actions);
  void end_job(JobState& job, JobPhase phase, Time now, Actions& actions);
  void drop_work(JobState& job, Outcome outcome, Time now, Actions& actions);
  void begin_again(JobState& job, Time now, Actions& actions);
  void bind_jobs(Time now, Actions& actions);

  // attempts (queue_attempts.cpp)
  const Attempt& begin_attempt(Attempt attempt, Time now);
  [[nodiscard]] AttemptRecord record_of(const Attempt& attempt) const;
  Attempt end_attempt(std::uint64_t id, Outcome outcome, const std::string& message, Time now,
                      Actions& actions);
  void renew(Attempt& attempt, Time now);
  void restore(const JobState& job, std::size_t stage, const PriorAttempt& prior, Time now,
               Actions& actions);

  // shards (queue_shards.cpp)
  void finish_shard(const core::Digest& work, const core::Digest& result, Time now,
                    Actions& actions);
  void release(const Attempt& attempt);
  void lose(std::uint64_t id, Time now, Actions& actions);
  void expire(Time now, Actions& actions);
  void fail_shard(const Attempt& attempt, const Failure& failure, Time now, Actions& actions);
  void back_off(const Attempt& attempt, const std::string& worker, Time now);
  void sample_rate(std::uint64_t order, Time now);
  void forget_ref(const core::Digest& work, const ShardRef& ref);

  // reports (queue_report.cpp)
  void complete(const ReportEvent& report, const CompletionClaim& claim, Time now,
                Actions& actions);
  void take_results(const JobState& job, const Attempt& run, const CompletionClaim& claim,
                    const std::string& worker, Time now, Actions& actions);
  void keep(const ReportEvent& report, const RunningClaim& claim, Time now, Actions& actions);
  [[nodiscard]] std::string make_token(const StageState& stage, std::uint64_t first,
                                       std::uint64_t count) const;
  [[nodiscard]] Recognised recognise(const std::string& job_id, std::uint64_t attempt,
                                     const std::string& token, Attempt* run);
  [[nodiscard]] bool adopt(const Attempt& run, const std::string& worker, Time now,
                           Actions& actions);

  // assignments (queue_assign.cpp)
  struct Run {
    std::uint64_t job_order = 0;
    std::size_t stage = 0;
    std::uint64_t first_shard = 0;
    std::uint64_t shards = 0;
  };
  void assign(const ReportEvent& report, Time now, Actions& actions);
  [[nodiscard]] std::optional<Run> next_run(const WorkerState& worker, bool is_busy, Time now);
  [[nodiscard]] std::optional<Run> run_of(std::uint64_t order, std::size_t index,
                                          const WorkerState& worker, std::uint64_t limit, Time now);
  [[nodiscard]] bool may_run(const StageState& stage, const ShardRef& ref,
                             const WorkerState& worker, Time now) const;
  [[nodiscard]] std::uint64_t run_size(const JobState& job, const StageState& stage,
                                       const WorkerState& worker, bool is_busy, Time now) const;
  [[nodiscard]] AssignAction describe(const Attempt& attempt) const;

  QueueSettings settings_;
  std::uint64_t next_attempt_;
  std::uint64_t next_order_ = 0;
  std::map<std::uint64_t, JobState> jobs_;  // by order of submission
  std::map<std::string, std::uint64_t> order_of_job_;
  std::map<std::string, WorkerState> workers_;
  std::map<std::uint64_t, Attempt> attempts_;        // those that own their shards
  std::set<std::pair<Time, std::uint64_t>> leases_;  // by their ends
  std::map<std::string, std::set<std::uint64_t>> attempts_of_worker_;  // by the worker's id
  std::set<std::string> drained_;                                      // names of workers
  std::map<std::string, std::set<StageName>> blocked_;  // names of workers: kinds of tasks
  // The unfinished shards of all jobs, by the digest of their work.
  std::unordered_map<core::Digest, std::vector<ShardRef>, core::DigestHash> unfinished_;
};

}  // namespace weft::coordinator
