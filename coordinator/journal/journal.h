#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "coordinator/journal/catalogue_tables.h"
#include "coordinator/queue/events.h"
#include "core/digest.h"
#include "core/error.h"

namespace weft::coordinator {

// A job as it is kept. An unfinished one has neither `ended_at_ms` nor `summary`.
struct JobRecord {
  std::string id;
  std::string request_id;
  std::string fabric;
  std::string description;  // canonical bytes of the FabricDescription
  std::string comment;
  std::optional<core::Digest> fingerprint;
  std::int64_t submitted_at_ms = 0;
  std::int64_t ended_at_ms = 0;
  std::string summary;  // the ended job's v1::Job, serialised
  JobDemands demands;
  bool is_paused = false;
  std::uint32_t retries = 0;  // how often it was put back into the queue
};

// Closes the job's attempts that still run, and forgets its failures.
struct JobEndRecord {
  std::string job;
  std::int64_t ended_at_ms = 0;
  std::string summary;
};
// The job has not ended after all; its failures and mismatches are forgotten.
struct RetryRecord {
  std::string job;
};
struct PauseRecord {
  std::string job;
  bool is_paused = true;
};
struct PriorityRecord {
  std::string job;
  std::int32_t priority = 0;
};
struct DrainRecord {
  std::string worker;  // name
  bool is_drained = true;
};
// An order of a person was carried out: the same request_id again changes nothing.
struct OrderRecord {
  std::string request_id;
};

using Record = std::variant<JobRecord, JobEndRecord, RetryRecord, PauseRecord, PriorityRecord,
                            DrainRecord, OrderRecord, BindRecord, ResultRecord, ResultDropRecord,
                            AuditRecord, FailureRecord, FailuresDropRecord, BlockRecord,
                            AttemptRecord, AttemptEndRecord, MismatchRecord>;

// An attempt as it is kept; without `end` it was running when last heard of.
struct KeptAttempt {
  AttemptRecord begin;
  std::optional<AttemptEndRecord> end;
  // It had ended and its worker took it up again: how often, and of the last time when, and how and
  // when it had ended.
  std::uint32_t taken_up = 0;
  std::int64_t taken_up_at_ms = 0;
  Outcome earlier_outcome = Outcome::kLost;
  std::int64_t earlier_ended_at_ms = 0;
};

// The result of a shard's work.
struct KeptResult {
  core::Digest result;
  std::string worker;  // name; empty: unknown
  bool is_audited = false;
};

// What is pruned, and when: of an unfinished job, and of the kAttemptJobsLimit that ended last, the
// last kEndedAttemptsLimit ended attempts stay (and a quarter more, between two prunings); the
// kEndedJobsKept jobs that ended last stay; the last kOrdersKept orders stay. Results stay until
// they are forgotten.
inline constexpr std::uint64_t kEndedAttemptsLimit = 1'000;
inline constexpr std::uint64_t kAttemptJobsLimit = 1'000;
inline constexpr std::uint64_t kEndedJobsKept = 10'000;
inline constexpr std::uint64_t kOrdersKept = 10'000;

// What the coordinator must not forget, in one SQLite file: jobs, attempts, failures, what was
// found of workers, the cache of results by digest, and the catalogue. One connection, exclusively
// locked for as long as the journal lives; WAL, synchronous=FULL. Any thread may call anything.
// Every member may throw core::Error(kUnavailable) when the file cannot be read or written; after a
// failed write all further ones fail too, because memory is then ahead of the disk: the process
// must end and start again from what the file holds.
class Journal {
 public:
  using Ticket = std::uint64_t;

  // Opens or creates the file, brings one of an older schema up to date, and counts the start.
  // Throws core::Error(kFailedPrecondition) when another process has it open or it was written by a
  // newer program.
  explicit Journal(const std::filesystem::path& file);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;
  Journal(Journal&&) = delete;
  Journal& operator=(Journal&&) = delete;

  // Counts the times the file was opened, from 1.
  [[nodiscard]] std::uint32_t epoch() const;

  // Queues records for the next group commit, in order and all or nothing; they and all earlier
  // ones are durable when wait(ticket) has returned. No records: the ticket of all so far.
  Ticket append(std::vector<Record> records);
  void wait(Ticket ticket);
  // Calls `done` as soon as the ticket is durable, or with what went wrong: at once and in this
  // thread where that is known already, else in a thread of the journal's, one after another and
  // in the order of the tickets. Does not throw.
  using Done = std::function<void(const std::optional<core::Error>&)>;
  void when_durable(Ticket ticket, Done done);

  // All look-ups see what was appended before.

  // Unfinished jobs in the order of submission, then the last `ended_limit` ended ones, the newest
  // first.
  [[nodiscard]] std::vector<JobRecord> jobs(std::size_t ended_limit);
  [[nodiscard]] std::optional<JobRecord> job(const std::string& id);
  [[nodiscard]] std::optional<JobRecord> job_of_request(const std::string& request_id);

  // The result of each shard's work, where known. Others may use the journal meanwhile: what they
  // append may be seen or not.
  [[nodiscard]] std::vector<std::optional<KeptResult>> results_of(
      std::span<const core::Digest> shards);
  // Forgets all shards whose result this is, and says how many.
  std::uint64_t forget_result(const core::Digest& result);

  [[nodiscard]] std::vector<FailureRecord> failures_of(const std::string& job, StageName stage);
  // Of one stage, those that have not ended, by number.
  [[nodiscard]] std::vector<AttemptRecord> running_attempts(const std::string& job,
                                                            StageName stage);
  // The newest first; `wanted` says which, and is asked at most once for each.
  [[nodiscard]] std::vector<KeptAttempt> attempts_of(
      const std::string& job, std::size_t limit,
      const std::function<bool(const AttemptRecord&)>& wanted);
  [[nodiscard]] std::vector<MismatchRecord> mismatches_of(const std::string& job);
  [[nodiscard]] std::vector<BlockRecord> blocks();
  [[nodiscard]] std::vector<std::string> drained();  // names of workers
  [[nodiscard]] std::vector<std::string> orders();   // request_ids, oldest first
  [[nodiscard]] std::uint64_t size_bytes() const;    // of what is in use in the file

  // The catalogue's part of the same file.
  [[nodiscard]] JournalCatalogue& catalogue();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::coordinator
