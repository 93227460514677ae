#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "coordinator/queue/deaths.h"
#include "coordinator/queue/events.h"
#include "coordinator/queue/fairness.h"
#include "coordinator/queue/state.h"

namespace weft::coordinator {

// Why a worker cannot be given a stage's shards now.
enum class Obstacle : std::uint8_t {
  kNone,
  // For as long as the worker, the job and people's orders stay as they are:
  kLost,         // it is silent
  kFingerprint,  // its numbers differ from those the job began with
  kLabels,       // it lacks one that the job asks for
  kMemory,       // the stage needs more than it has
  kDrained,
  kBlocked,  // for this kind of task
  // For a while:
  kShort,       // it ran short of a resource
  kFailing,     // it failed several times in a row
  kMemoryHeld,  // what it runs leaves too little
  kWallTime,    // it must end before the work would
};
struct Hindrance {
  Obstacle obstacle = Obstacle::kNone;
  Time until{};  // the epoch: unknown
};

// The scheduler as a pure state machine: no I/O, no clock, no threads, no chance. What apply() does
// depends on the events so far and their times alone. A copy is a snapshot.
//
// Ownership
// - A shard is pending, running, done, or given up. Done is for ever, unless its result is lost or
//   proved wrong. Shards of equal digest, in whatever jobs, are done together, and one of them
//   runs.
// - An attempt is owned by the worker that was given it, for as long as its lease lasts; each
//   report that lists it renews the lease. Only the owner, with the lease's token, can fail an
//   attempt or free its shards; a worker that was started again under the same name may complete
//   what its forerunner owned. A success is taken from anybody while its shard is unfinished.
// - A second attempt at a shard is begun only to outrun a slow one (speculation: an idle worker,
//   the first result wins) or to check a result (audit). One that loses its lease frees only what
//   no other attempt runs. A worker that was silent for longer than its lease takes its attempt up
//   again if nobody else has begun any of its shards.
//
// Order of work
// - By priority, to which waiting adds a step every ageing_ms; then the user who was given least;
//   then the user's job that was given least (FairShare); then the order of submission. A worker
//   takes jobs whose scene it holds first, as long as these are at most kNearLead runs ahead of
//   their share. Within a job: stages in their order, each one's audits after its pending shards.
//
// Verdicts are in verdicts.h, audits in audits.cpp.
class Queue {
 public:
  // `epoch` counts the coordinator's starts: attempts of different epochs never have the same
  // number. REQUIRES: epoch > 0.
  explicit Queue(QueueSettings settings, std::uint32_t epoch);

  // The caller sends a TickEvent about once a second. A clock that jumps by more than stall_ms, or
  // a coordinator that stood still for so long, ends no lease and prolongs none.
  [[nodiscard]] Actions apply(const Event& event, Time now);

  // Nothing when there is no such job. Ended jobs stay until forget_job.
  [[nodiscard]] const JobState* job(const std::string& id) const;
  [[nodiscard]] std::vector<const JobState*> jobs() const;  // in the order of submission
  void forget_job(const std::string& id);                   // REQUIRES: it has ended
  // For QueueSettings::user_jobs_limit, which the caller enforces when a job is submitted.
  [[nodiscard]] std::size_t unfinished_jobs_of(const std::string& user) const;

  [[nodiscard]] const std::map<std::string, WorkerState>& workers() const { return workers_; }
  [[nodiscard]] const std::map<std::uint64_t, Attempt>& attempts() const { return attempts_; }
  // Those of one worker, the oldest first.
  [[nodiscard]] std::vector<const Attempt*> attempts_of(const std::string& worker_id) const;
  [[nodiscard]] bool is_drained(const std::string& worker_name) const;
  [[nodiscard]] std::vector<StageName> blocked_stages(const std::string& worker_name) const;
  [[nodiscard]] bool is_liar(const std::string& worker_name, StageName stage) const;
  [[nodiscard]] bool is_live(const WorkerState& worker, Time now) const;
  [[nodiscard]] const QueueSettings& settings() const { return settings_; }
  [[nodiscard]] const std::map<core::Digest, Dispute>& disputes() const { return disputes_; }
  // Whose results StageState::authors names; empty: unknown.
  [[nodiscard]] const std::string& author_name(std::uint32_t author) const;

  // What plan() and commit() read: the stages that are done, in the order they were planned.
  [[nodiscard]] std::vector<StageResults> finished_stages(const JobState& job) const;

  // Shards per second over the last minute; 0 when unknown.
  [[nodiscard]] static double shards_per_second(const StageState& stage);
  // What an unfinished job lacks; empty when it moves. (coordinator/queue/explain.h says more.)
  [[nodiscard]] std::string waiting_for(const JobState& job, Time now) const;

  // The predicates by which work is given, for explanations too.
  [[nodiscard]] Hindrance hindrance(const WorkerState& worker, const JobState& job,
                                    const StageState& stage, Time now) const;
  // Names of the live workers whom nothing lasting keeps from the stage.
  [[nodiscard]] std::set<std::string> eligible(const JobState& job, const StageState& stage,
                                               Time now) const;
  // A shard that failed on this worker is left to others where it did not, if there are any.
  [[nodiscard]] bool is_left_to_others(const JobState& job, const StageState& stage,
                                       const ShardTrouble& trouble, const WorkerState& worker,
                                       Time now) const;
  [[nodiscard]] std::int64_t priority(const JobState& job, Time now) const;  // with its age
  // How long a run takes on so many threads, in milliseconds; 0: unknown.
  [[nodiscard]] static double expected_ms(const StageState& stage, std::uint64_t shards,
                                          std::uint32_t threads);

 private:
  struct ShardRef {
    std::uint64_t shard = 0;
    std::uint32_t job_order = 0;
    std::uint32_t stage = 0;
    bool operator==(const ShardRef&) const = default;
  };
  struct Run {
    std::uint64_t job_order = 0;
    std::size_t stage = 0;
    std::uint64_t first_shard = 0;
    std::uint64_t shards = 0;
    Purpose purpose = Purpose::kFirst;
    std::size_t losses = 0;
  };
  // An attempt whose worker fell silent, which may yet come back with it.
  struct LostAttempt {
    std::string worker;
    Time at{};
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
  void end_job(JobState& job, JobPhase phase, Time now, Actions& actions);
  void drop_work(JobState& job, Outcome outcome, Time now, Actions& actions);
  void begin_again(JobState& job, Time now, Actions& actions);
  void settle(JobState& job, Time now, Actions& actions);
  void refresh(JobState& job, Time now);
  void bind_jobs(Time now, Actions& actions);

  // stages (stages.cpp)
  void add_stage(std::uint64_t order, JobState& job, const PlannedStage& planned, Time now,
                 Actions& actions);
  void add_known(std::uint64_t order, JobState& job, std::size_t index, const PlannedStage& planned,
                 Time now, Actions& actions);
  void add_failures(JobState& job, std::size_t index, const PlannedStage& planned, Time now);
  void restore(JobState& job, std::size_t index, const PriorAttempt& prior, Time now,
               Actions& actions);

  // attempts (attempts.cpp)
  const Attempt& begin_attempt(Attempt attempt, Time now);
  [[nodiscard]] AttemptRecord record_of(const Attempt& attempt) const;
  Attempt end_attempt(std::uint64_t id, Outcome outcome, const std::string& message, Time now,
                      Actions& actions);
  std::uint64_t take_shards(Attempt& attempt);
  void renew(Attempt& attempt, Time now);
  void stop_attempts(JobState& job, Outcome outcome, const std::string& why, Time now,
                     Actions& actions);
  void expire(Time now, Actions& actions);

  // shards (shards.cpp)
  [[nodiscard]] std::uint32_t author_of(const std::string& worker_name);
  void add_ref(const core::Digest& work, const ShardRef& ref);
  void forget_ref(const core::Digest& work, const ShardRef& ref);
  void finish_shard(const core::Digest& work, const core::Digest& result, const std::string& worker,
                    Time now, Actions& actions);
  void mark_done(const ShardRef& ref, const core::Digest& result, std::uint32_t author, Time now,
                 Actions& actions);
  void mark_running(const ShardRef& ref);
  void make_pending(const ShardRef& ref, std::size_t losses);
  static void put_back(StageState& stage, std::uint64_t shard, std::size_t losses);
  static void withdraw(StageState& stage, std::uint64_t shard);
  void release(const Attempt& attempt, std::size_t losses, Time now);
  void free_twins(const ShardRef& ref, Time now);
  void sample_rate(std::uint64_t order, Time now);

  // trouble (trouble.cpp)
  void lose(std::uint64_t id, Time now, Actions& actions);
  void take_away(std::uint64_t id, Time now, Actions& actions);
  void fail_shard(const Attempt& attempt, std::uint64_t shard, const std::string& message,
                  TroubleKind kind, Time now, Actions& actions);
  void judge(JobState& job, std::size_t stage, std::uint64_t shard, Time now, Actions& actions);
  void quarantine(JobState& job, std::size_t stage, std::uint64_t shard, const Verdict& verdict,
                  Time now, Actions& actions);
  void confirm_losses(JobState& job, std::size_t stage, Time now, Actions& actions);
  [[nodiscard]] bool survives(const LoneLoss& loss) const;
  [[nodiscard]] std::map<std::string, std::size_t> losses_elsewhere(const JobState& job,
                                                                    const StageState& stage,
                                                                    std::uint64_t shard) const;
  static void absolve(StageState& stage, std::uint64_t shard, const std::string& worker_name);
  void short_of_resource(const Attempt& attempt, const std::string& worker, Time now);
  void note_failure(StageState& stage, const std::string& worker, Time now);
  void passed_elsewhere(const std::string& worker_name, StageName stage, Time now,
                        Actions& actions);
  void block(const std::string& worker_name, StageName stage, bool is_liar, Time now,
             Actions& actions);
  void forgive(const std::string& worker_name, StageName stage, Time now, Actions& actions);
  void forgive_shard(const ShardRef& ref, const std::string& worker_name, Time now);

  // audits (audits.cpp)
  [[nodiscard]] static bool is_chosen(const core::Digest& work, double share);
  void await_audit(StageState& stage, std::uint64_t shard, Time now);
  bool take_audit(StageState& stage, std::uint64_t shard, std::uint64_t attempt);
  void compare(JobState& job, std::size_t stage, std::uint64_t shard,
               const Dispute::Opinion& opinion, Time now, Actions& actions);
  void confirm(JobState& job, StageState& stage, std::uint64_t shard, const std::string& worker,
               Time now, Actions& actions);
  void audit_not_done(const Attempt& attempt, std::uint64_t shard, Time now, Actions& actions);
  void put_back_audits(const Attempt& attempt, Time now);
  void doubt(const std::string& worker_name, StageName stage, Time now);
  void look_after_audits(Time now, Actions& actions);
  void look_after_audits(JobState& job, StageState& stage, Time now);

  // disputes (disputes.cpp)
  void dispute(JobState& job, std::size_t stage, std::uint64_t shard,
               const Dispute::Opinion& opinion, Time now, Actions& actions);
  bool open_dispute(const core::Digest& work, Dispute dispute, Time now, Actions& actions);
  static void join_dispute(JobState& job, StageState& stage, std::uint64_t shard,
                           const Dispute& dispute, Actions& actions);
  static void restore_mismatches(JobState& job, const std::vector<MismatchRecord>& mismatches);
  bool dispute_again(JobState& job, std::size_t stage, std::uint64_t shard, Time now,
                     Actions& actions);
  void hear(const core::Digest& work, const Dispute::Opinion& opinion, Time now, Actions& actions);
  void resolve(const core::Digest& work, const core::Digest& right, Time now, Actions& actions);
  void replace(const core::Digest& work, const Dispute& dispute, const Dispute::Opinion& right,
               Time now, Actions& actions);
  void give_up(const core::Digest& work, const std::string& why, Time now, Actions& actions);
  [[nodiscard]] bool is_disputed(std::uint64_t order, const Trouble& trouble,
                                 const core::Digest& work) const;
  void leave_disputes(const JobState& job, Actions& actions);

  // reports (report.cpp)
  void enter(const ReportEvent& report, Time now, Actions& actions);
  void complete(const ReportEvent& report, const CompletionClaim& claim, Time now,
                Actions& actions);
  void complete_own(const ReportEvent& report, const CompletionClaim& claim, Time now,
                    Actions& actions);
  std::uint64_t take_results(JobState& job, const Attempt& run, const CompletionClaim& claim,
                             const ReportEvent& report, Time now, Actions& actions);
  void measure(const Attempt& attempt, const CompletionClaim& claim, std::uint32_t threads);
  void keep(const ReportEvent& report, const RunningClaim& claim, Time now, Actions& actions);
  void count_superseded(const ReportEvent& report, const std::string& job, std::uint64_t attempt);
  [[nodiscard]] bool is_needed(const Attempt& attempt) const;
  [[nodiscard]] std::string make_token(const StageState& stage, std::uint64_t first,
                                       std::uint64_t count) const;
  [[nodiscard]] Recognised recognise(const std::string& job_id, std::uint64_t attempt,
                                     const std::string& token, Attempt* run);
  [[nodiscard]] bool adopt(const Attempt& run, const std::string& worker, Time now,
                           Actions& actions);

  // assignments (assign.cpp, runs.cpp)
  void assign(const ReportEvent& report, Time now, Actions& actions);
  void give(const Run& run, const WorkerState& worker, Time now, Actions& actions);
  [[nodiscard]] std::vector<std::uint64_t> order_for(const WorkerState& worker, Time now) const;
  [[nodiscard]] std::optional<Run> next_run(const WorkerState& worker, bool is_busy, Time now);
  [[nodiscard]] std::optional<Run> pending_run(std::uint64_t order, std::size_t stage,
                                               const WorkerState& worker, std::uint64_t limit,
                                               Time now) const;
  [[nodiscard]] std::optional<Run> audit_run(std::uint64_t order, std::size_t stage,
                                             const WorkerState& worker, std::uint64_t limit) const;
  [[nodiscard]] std::optional<Run> second_run(const WorkerState& worker, Time now) const;
  [[nodiscard]] std::uint64_t run_size(const JobState& job, const StageState& stage,
                                       const WorkerState& worker, bool is_busy, Time now) const;
  [[nodiscard]] std::uint64_t sized(const StageState& stage, const WorkerState& worker,
                                    std::uint64_t share, Time now) const;
  [[nodiscard]] AssignAction describe(const Attempt& attempt) const;

  // workers (workers.cpp)
  void count(WorkerState& worker, Time now);
  void uncount(WorkerState& worker);
  [[nodiscard]] bool lacks_memory(const WorkerState& worker, const StageState& stage) const;
  [[nodiscard]] double wall_left_ms(const WorkerState& worker, Time now) const;

  // watch (watch.cpp)
  void watch(Time now, Actions& actions);
  void watch_worker(const std::set<std::uint64_t>& attempts, Time now,
                    std::vector<std::uint64_t>* hung);
  void shift(std::chrono::milliseconds by);

  QueueSettings settings_;
  std::uint64_t next_attempt_;
  std::uint64_t next_order_ = 0;
  Time last_event_at_{};
  std::map<std::uint64_t, JobState> jobs_;  // by order of submission
  std::map<std::string, std::uint64_t> order_of_job_;
  std::set<std::uint64_t> ready_;  // jobs that have something for a worker
  FairShare shares_;

  std::map<std::string, WorkerState> workers_;
  std::map<core::Digest, WorkerPool> pools_;  // by fingerprint
  std::set<std::string> drained_;             // names of workers
  // Names of workers: kinds of tasks, and whether it gave wrong results of them.
  std::map<std::string, std::map<StageName, bool>> blocked_;
  std::map<std::pair<std::string, StageName>, Conduct> conduct_;  // by the worker's name
  std::map<std::string, Time> passed_at_;  // when a worker of a name last gave results

  std::map<std::uint64_t, Attempt> attempts_;        // those that own their shards
  std::set<std::pair<Time, std::uint64_t>> leases_;  // by their ends
  std::map<std::string, std::set<std::uint64_t>> attempts_of_worker_;  // by the worker's id
  std::map<std::uint64_t, LostAttempt> lost_;
  Deaths deaths_;
  // Attempts of earlier epochs that ended in this one for another reason than silence: they are not
  // taken up again.
  std::set<std::uint64_t> ended_for_good_;
  std::set<std::uint64_t> slow_;  // attempts that an idle worker may try to outrun

  // The unfinished shards of all jobs, by the digest of their work; and how many of them have the
  // same digest as an earlier one.
  std::unordered_multimap<core::Digest, ShardRef, core::DigestHash> unfinished_;
  std::uint64_t twins_ = 0;
  std::map<core::Digest, Dispute> disputes_;  // by the digest of the work
  std::vector<std::string> names_{std::string()};
  std::map<std::string, std::uint32_t> author_of_name_;
};

}  // namespace weft::coordinator
