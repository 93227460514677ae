#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "coordinator/queue/queue.h"
#include "proto/weft/v1/cluster.pb.h"
#include "tests/simulation/checks.h"
#include "tests/simulation/disk.h"
#include "tests/simulation/ground.h"

namespace weft::simulation {

// A coordinator as coordinator::Scheduler and its services make one, around the real queue, in
// virtual time: records go to the journal, answers leave when these are durable, planning and
// committing take their time, and a crash may come between any two steps. Answers to calls that a
// crash cut off never come.
class CoordinatorModel {
 public:
  using Done = std::function<void()>;
  // Null: a newer call of this worker was seen.
  using Answer = std::function<void(const v1::SynchronizeResponse*)>;

  CoordinatorModel(Ground& ground, Checks& checks, coordinator::QueueSettings settings)
      : ground_(ground), checks_(checks), settings_(settings) {}

  [[nodiscard]] bool is_up() const { return process_ != nullptr; }
  [[nodiscard]] std::uint32_t starts() const { return journal_.durable().epoch; }
  void start();
  void crash();

  // REQUIRES of all calls: it is up. Orders for jobs and workers are answered when durable.
  void submit(const JobRow& job, Done done);
  void cancel(const std::string& job, Done done);
  void retry(const std::string& job, Done done);
  void pause(const std::string& job, bool is_paused, Done done);
  void prioritise(const std::string& job, std::int32_t priority, Done done);
  void drain(const std::string& worker_name, bool is_drained, Done done);
  void unblock(const std::string& worker_name, StageName stage, Done done);

  void synchronize(const v1::SynchronizeRequest& request, Answer answer);
  // The worker gave that call up, or its connection closed.
  void hang_up(const std::string& worker, std::uint64_t sequence);
  void connection_closed(const std::string& worker);
  [[nodiscard]] bool write_blob(const core::Digest& digest, const std::string& bytes);
  [[nodiscard]] std::optional<std::string> read_blob(const core::Digest& digest);

  // The wall clock by which the queue is told the time.
  [[nodiscard]] Time now() const;
  void set_clock(std::int64_t offset_ms) { clock_offset_ms_ = offset_ms; }
  [[nodiscard]] std::int64_t clock_offset_ms() const { return clock_offset_ms_; }

  [[nodiscard]] const coordinator::Queue* queue() const;
  [[nodiscard]] const JournalDisk& journal() const { return journal_; }
  [[nodiscard]] BlobDisk& blobs() { return blobs_; }
  // Whether somebody is at work on it, or it is next.
  [[nodiscard]] bool is_being_planned(const coordinator::JobState& job) const;
  [[nodiscard]] bool is_being_committed(const coordinator::JobState& job) const;

 private:
  struct JobFile {
    FakeFabric fabric;
    std::map<StageName, FakeStage> stages;  // planned, of the present generation
    std::uint32_t generation = 0;
    std::optional<core::Digest> database;
  };
  struct HeldCall {
    coordinator::ReportEvent report;
    std::uint64_t sequence = 0;
    std::uint64_t deadline_ms = 0;
    std::uint64_t looks = 0;
    Answer answer;
  };
  template <class Task>
  struct Desk {
    std::deque<Task> waiting;
    std::optional<Task> under_way;
  };
  // What a crash takes.
  struct Process {
    Process(const coordinator::QueueSettings& settings, std::uint32_t starts)
        : queue(settings, starts), epoch(starts) {}
    coordinator::Queue queue;
    std::uint32_t epoch;
    std::map<std::string, JobFile> files;
    std::map<std::string, std::uint64_t> sequences;
    std::map<std::string, std::uint64_t> closed_ms;  // connections
    std::map<std::string, HeldCall> held;            // by worker
    std::multimap<std::uint64_t, Done> waiting;      // for a ticket
    Desk<coordinator::PlanAction> plans;
    Desk<coordinator::CommitAction> commits;
    bool will_look = false;
  };

  void later(std::uint64_t delay_ms, Done action);
  std::uint64_t apply(const coordinator::Event& event, coordinator::Reply* reply,
                      std::vector<Row> rows = {});
  void tell(const coordinator::Actions& actions) const;
  void end_job(const std::string& id, std::vector<Row>& rows);
  void when_durable(std::uint64_t ticket, Done done);
  void sync_when_idle();
  void finish_sync();
  void tick();
  void load();

  void look(const std::string& worker, std::uint64_t sequence, std::uint64_t look);
  void look_at_all();
  [[nodiscard]] v1::SynchronizeResponse message(const coordinator::Reply& reply) const;

  void next_plan();
  void next_commit();
  void finish_plan(const std::vector<coordinator::StageResults>& finished);
  void finish_commit(const std::vector<coordinator::StageResults>& finished);
  void result_lost(const core::Digest& result);
  [[nodiscard]] std::string read_or_lose(const core::Digest& digest);
  [[nodiscard]] coordinator::PlannedStage with_known(const std::string& job, const FakeStage& stage,
                                                     const core::Digest& fingerprint);

  Ground& ground_;
  Checks& checks_;
  const coordinator::QueueSettings settings_;
  JournalDisk journal_;
  BlobDisk blobs_;
  std::int64_t clock_offset_ms_ = 0;
  std::uint64_t life_ = 0;
  std::unique_ptr<Process> process_;
};

}  // namespace weft::simulation
