#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/journal/journal.h"
#include "coordinator/journal/order_log.h"
#include "coordinator/queue/queue.h"
#include "coordinator/scheduler/census.h"
#include "coordinator/scheduler/log_store.h"
#include "coordinator/scheduler/messages.h"
#include "coordinator/scheduler/waiting_calls.h"
#include "coordinator/versions/catalogue.h"
#include "core/clock.h"
#include "proto/weft/v1/cluster.pb.h"
#include "security/caller.h"
#include "storage/blob_store.h"

namespace weft::coordinator {

// coordinator::commit's type.
using CommitFunction = std::function<core::Digest(
    const v1::FabricDescription& description, const std::vector<StageResults>& results,
    const std::function<std::string(const core::Digest&)>& read_blob,
    const std::filesystem::path& path)>;

// Who counts what happens. Called with the scheduler's lock held: quickly, and without calling the
// scheduler. Empty functions are not called.
struct SchedulerHooks {
  std::function<void(const Actions& actions)> acted;  // after every event
  std::function<void(const v1::Job& job)> job_ended;
};

struct SchedulerOptions {
  std::filesystem::path state_folder;  // docs/architecture.md says what is in it
  QueueSettings queue;
  CommitFunction commit;
  // Nothing is submitted any more when the journal has grown to so much.
  std::uint64_t journal_limit_bytes = std::uint64_t{16} << 30;
  // When our own disk fails, planning and assembling are tried again after so long, then after
  // twice as long each time, for a quarter of an hour.
  std::chrono::milliseconds put_off{1000};
  SchedulerHooks hooks;
};

inline constexpr std::size_t kUnfinishedJobsLimit = 1000;
inline constexpr std::size_t kEndedJobsLimit = 1000;  // kept in memory, and listed

// What a person orders about a job or a worker. The same request_id again changes nothing.
struct Order {
  std::string request_id;
  std::string subject;  // a job's id or its beginning; a worker's name, id or its beginning
  security::Caller caller;
};

// The coordinator without its network: turns calls into events of the queue, makes what they did
// durable before it answers, and plans and commits in threads of its own. Any thread may call.
// Everything that was promised is in the state folder: a scheduler made on the folder of one that
// was killed goes on where that one was.
class Scheduler {
 public:
  // Throws core::Error(kFailedPrecondition) when another process uses the folder. `clock` must
  // outlive the scheduler.
  Scheduler(SchedulerOptions options, const core::Clock& clock);
  ~Scheduler();
  Scheduler(const Scheduler&) = delete;
  Scheduler& operator=(const Scheduler&) = delete;
  Scheduler(Scheduler&&) = delete;
  Scheduler& operator=(Scheduler&&) = delete;

  // Errors as cluster.proto states them for the calls of the same names.
  [[nodiscard]] v1::Job submit(const v1::SubmitRequest& request, const security::Caller& caller);
  [[nodiscard]] v1::Job cancel(const Order& order);
  [[nodiscard]] v1::Job pause(const Order& order, bool is_paused);
  [[nodiscard]] v1::Job retry(const Order& order);
  [[nodiscard]] v1::Job set_priority(const Order& order, std::int32_t priority);
  [[nodiscard]] v1::Job job(const std::string& id_or_beginning);
  [[nodiscard]] std::vector<v1::Job> jobs(bool unfinished_only, std::size_t limit);
  [[nodiscard]] v1::ExplainResponse explain(const v1::ExplainRequest& request);
  [[nodiscard]] std::vector<v1::AttemptInfo> attempts(const v1::ListAttemptsRequest& request);

  [[nodiscard]] std::vector<v1::Worker> workers();
  [[nodiscard]] Census census();
  [[nodiscard]] std::uint64_t journal_bytes() const { return journal_.size_bytes(); }
  // Throws core::Error(kResourceExhausted) when the journal has grown to its limit.
  void check_journal_limit() const;
  // Both answer with all workers of that name.
  [[nodiscard]] std::vector<v1::Worker> drain(const Order& order, bool is_drained);
  [[nodiscard]] std::vector<v1::Worker> unblock(const Order& order, const std::string& stage);

  // The job as soon as its revision is another than `seen`, or after `timeout`.
  [[nodiscard]] v1::Job wait_for_change(const std::string& job_id, std::uint64_t seen,
                                        std::chrono::milliseconds timeout);

  // One exchange with a worker. `answer` is called once, by any thread, before or after this
  // returns: with a response when there is something to say and it is durable, or when `wait` is
  // over; with nothing when a newer call of this worker came or this one was abandoned; with what
  // went wrong. It must not throw and not call the scheduler. The blobs of the results that
  // `report` names are known to be there. Throws what is wrong with the call itself.
  void synchronize(ReportEvent report, std::uint64_t sequence, std::chrono::milliseconds wait,
                   ExchangeAnswer answer);
  // The call with this sequence was cancelled or its connection closed. A worker that makes no
  // newer one within QueueSettings::disconnect_ms is lost.
  void abandon(const std::string& worker, std::uint64_t sequence);

  // A blob that was there is damaged or gone: forgets the results that it was, so that they are
  // computed again.
  void result_lost(const core::Digest& result);

  [[nodiscard]] storage::BlobStore& blobs() { return blobs_; }
  [[nodiscard]] Catalogue& catalogue() { return catalogue_; }
  [[nodiscard]] LogStore& logs() { return logs_; }
  // Whether the job has that attempt, and while it owns its shards, that token. Throws
  // core::Error(kNotFound) when there is no such job.
  [[nodiscard]] bool was_given(const std::string& job_id, std::uint64_t attempt,
                               const std::string& token);

  // For the garbage collector. Results that unfinished jobs have or will be assembled from. Throws
  // core::Error(kFailedPrecondition) while a job is not planned, and nobody knows its results.
  [[nodiscard]] std::set<core::Digest> results_in_use();
  // Forgets results whose blobs are gone.
  void forget_gone(const std::vector<core::Digest>& results);

  // Ends all waiting calls; those and further ones get core::Error(kUnavailable).
  void stop();
  // Why the process must end (the journal cannot be written), if it must.
  [[nodiscard]] std::optional<std::string> fatal_problem();

 private:
  // What the queue does not need to know of a job.
  struct JobFile {
    v1::FabricDescription description;
    std::string comment;
    std::string user;
    std::map<StageName, Stage> stages;  // planned, of the present generation
    std::uint32_t generation = 0;
    std::uint64_t first_revision = 0;  // of a job that was put back into the queue
    std::string problem;               // why its database could not be assembled yet
    std::optional<VersionRecord> version;
    std::uint64_t cached_bytes = 0;  // of results that were not computed again
  };
  struct Task {
    std::variant<PlanAction, CommitAction> what;
    std::uint32_t tries = 0;
    Time not_before{};
  };
  // What is to be said as soon as the ticket is durable, without mutex_.
  struct PendingAnswer {
    Journal::Ticket ticket = 0;
    v1::SynchronizeResponse response;
    std::optional<core::Error> problem;
    ExchangeAnswer answer;
  };
  // Results that were recorded or forgotten while a stage's known results are looked up.
  struct RecentResults {
    bool is_kept = false;
    std::unordered_map<core::Digest, std::optional<KeptResult>, core::DigestHash> by_shard;
    std::unordered_set<core::Digest, core::DigestHash> lost;
  };

  // REQUIRES of all of these: mutex_ is held.
  void load();
  void load(const JobRecord& record);
  Journal::Ticket apply(const Event& event, Reply* reply, std::vector<Record> records = {});
  void log(const Actions& actions) const;
  std::optional<v1::Job> submitted_before(const JobRecord& record);
  void check_limits(const std::string& user) const;
  void end_job(const std::string& id, std::vector<Record>& records);
  [[nodiscard]] v1::Job message(const std::string& id) const;
  [[nodiscard]] std::string full_id(const std::string& beginning) const;
  [[nodiscard]] std::optional<std::uint64_t> revision_of(const std::string& id) const;
  [[nodiscard]] std::string worker_name(const std::string& name_or_id) const;
  [[nodiscard]] const WorkerState* find_worker(const std::string& name_or_id) const;
  [[nodiscard]] v1::Assignment message(const AssignAction& assign) const;
  [[nodiscard]] v1::SynchronizeResponse message(const Reply& reply) const;
  void check_running() const;
  v1::Job told(const std::string& id, std::unique_lock<std::mutex>& lock);

  // orders (orders.cpp); `change` is called with mutex_ held, unless the order is a
  // repeated one, to add its own to the records and apply its event
  using Change = std::function<Journal::Ticket(const std::string& subject, std::vector<Record>)>;
  v1::Job change_job(const Order& order, bool must_be_unfinished, const Change& change);
  std::vector<v1::Worker> change_worker(const Order& order, const Change& change);
  Journal::Ticket put_back(const std::string& id, std::vector<Record> records);

  // planning and committing (work.cpp)
  void work_through(std::deque<Task>& tasks);
  void work_on(Task task, std::deque<Task>& tasks);
  bool put_off(Task task, std::deque<Task>& tasks, const std::string& problem);
  void run(const PlanAction& task);
  void run(const CommitAction& task);
  void report(const Event& event);
  [[nodiscard]] std::optional<std::filesystem::path> remake(const VersionRecord& version);
  std::vector<PlannedStage> look_up(const std::string& job, const std::vector<Stage>& stages,
                                    const core::Digest& fingerprint, std::uint64_t& cached_bytes);
  void add_recent(PlannedStage& stage) const;  // REQUIRES: mutex_ is held
  [[nodiscard]] std::string read_blob(const core::Digest& digest);

  // waiting calls (exchange.cpp); mutex_ is held but in dispatch and send
  void dispatch();
  void dispatch_once(Time now, std::vector<PendingAnswer>& answers);
  bool look_at(const std::string& worker, bool must_answer, std::vector<PendingAnswer>& answers);
  void serve_hungry(std::vector<PendingAnswer>& answers);
  void tick();
  [[nodiscard]] Time next_dispatch() const;
  void send(std::vector<PendingAnswer> answers);

  SchedulerOptions options_;
  const core::Clock& clock_;
  Journal journal_;
  storage::BlobStore blobs_;
  Catalogue catalogue_;
  LogStore logs_;

  std::mutex mutex_;  // of everything below
  Queue queue_;
  std::map<std::string, JobFile> files_;  // of unfinished jobs
  std::map<std::string, v1::Job> ended_;
  std::deque<std::string> ended_order_;  // oldest first
  OrderLog orders_;
  RecentResults recent_;

  std::condition_variable tasks_changed_;
  std::deque<Task> to_plan_;
  std::deque<Task> to_commit_;

  std::condition_variable jobs_changed_;  // told at most ten times a second
  std::uint64_t watchers_ = 0;

  std::condition_variable dispatch_needed_;
  std::map<std::string, std::uint64_t> sequences_;  // of the newest call, by worker
  WaitingCalls waiting_;
  std::map<std::string, Time> gone_;  // workers whose connection closed, and when they are lost
  bool is_wake_pending_ = false;      // calls that want something may now get it
  Time next_tick_{};

  std::string fatal_;
  bool stopping_ = false;

  std::thread planner_;
  std::thread committer_;
  std::thread dispatcher_;
};

}  // namespace weft::coordinator
