#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "coordinator/catalogue.h"
#include "coordinator/journal.h"
#include "coordinator/messages.h"
#include "coordinator/queue.h"
#include "core/clock.h"
#include "proto/weft/v1/cluster.pb.h"
#include "storage/blob_store.h"

namespace weft::coordinator {

// coordinator::commit's type.
using CommitFunction = std::function<core::Digest(
    const v1::FabricDescription& description, const std::vector<StageResults>& results,
    const std::function<std::string(const core::Digest&)>& read_blob,
    const std::filesystem::path& path)>;

struct SchedulerOptions {
  std::filesystem::path state_folder;  // journal.db, blobs/, versions/, committing/
  QueueSettings queue;
  CommitFunction commit;
};

inline constexpr std::size_t kUnfinishedJobsLimit = 1000;
inline constexpr std::size_t kEndedJobsLimit = 1000;  // kept in memory, and listed

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
  [[nodiscard]] v1::Job submit(const v1::SubmitRequest& request);
  [[nodiscard]] v1::Job cancel(const std::string& job_id);
  [[nodiscard]] v1::Job job(const std::string& id_or_beginning);
  [[nodiscard]] std::vector<v1::Job> jobs(bool unfinished_only, std::size_t limit);
  [[nodiscard]] std::vector<v1::Worker> workers();

  // The job as soon as its revision is another than `seen`, or after `timeout`.
  [[nodiscard]] v1::Job wait_for_change(const std::string& job_id, std::uint64_t seen,
                                        std::chrono::milliseconds timeout);

  // One exchange with a worker; waits while there is nothing to say, until wait_ms is over or
  // `is_cancelled` says so (asked about once a second). Nothing when a newer call of this worker
  // came. The blobs of the results that `report` names are known to be there.
  [[nodiscard]] std::optional<v1::SynchronizeResponse> synchronize(
      ReportEvent report, std::uint64_t sequence, std::chrono::milliseconds wait,
      const std::function<bool()>& is_cancelled);

  // A blob that was there is damaged or gone: forgets the results that it was, so that they are
  // computed again.
  void result_lost(const core::Digest& result);

  [[nodiscard]] storage::BlobStore& blobs() { return blobs_; }
  [[nodiscard]] const Catalogue& catalogue() const { return catalogue_; }

  // Ends all waiting calls; those and further ones throw core::Error(kUnavailable).
  void stop();
  // Why the process must end (the journal cannot be written), if it must.
  [[nodiscard]] std::optional<std::string> fatal_problem();

 private:
  // What the queue does not need to know of a job.
  struct JobFile {
    v1::FabricDescription description;
    std::string comment;
    std::map<StageName, Stage> stages;  // planned, of the present generation
    std::uint32_t generation = 0;
    std::optional<VersionRecord> version;
  };
  using Task = std::variant<PlanAction, CommitAction>;

  void load();
  Journal::Ticket apply(const Event& event, Reply* reply);           // REQUIRES: mutex_ is held
  std::optional<v1::Job> submitted_before(const JobRecord& record);  // REQUIRES: mutex_ is held
  void end_job(const std::string& id, std::vector<Record>& records);
  void work_through(std::deque<Task>& tasks);
  void run(const PlanAction& task);
  void run(const CommitAction& task);
  void report(const Event& event);
  void tick();
  PlannedStage with_known(const std::string& job, const Stage& stage,
                          std::vector<core::Digest> digests);
  [[nodiscard]] std::string read_blob(const core::Digest& digest);
  [[nodiscard]] v1::Job message(const std::string& id) const;  // REQUIRES: mutex_ is held
  [[nodiscard]] std::string full_id(const std::string& beginning) const;
  [[nodiscard]] v1::Assignment message(const AssignAction& assign) const;
  [[nodiscard]] v1::SynchronizeResponse message(const Reply& reply) const;
  void check_running() const;

  SchedulerOptions options_;
  const core::Clock& clock_;
  Journal journal_;
  storage::BlobStore blobs_;
  Catalogue catalogue_;

  std::mutex mutex_;  // of everything below
  std::condition_variable changed_;
  Queue queue_;
  std::map<std::string, JobFile> files_;  // of unfinished jobs
  std::map<std::string, v1::Job> ended_;
  std::deque<std::string> ended_order_;  // oldest first
  std::map<std::string, std::uint64_t> sequences_;
  std::uint64_t wakes_ = 0;
  std::deque<Task> to_plan_;
  std::deque<Task> to_commit_;
  std::string fatal_;
  bool stopping_ = false;

  std::thread planner_;
  std::thread committer_;
  std::thread ticker_;
};

}  // namespace weft::coordinator
