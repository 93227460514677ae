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

#include "coordinator/journal_catalogue.h"
#include "coordinator/queue_events.h"
#include "core/digest.h"

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
};

struct JobEndRecord {
  std::string job;
  std::int64_t ended_at_ms = 0;
  std::string summary;
};

using Record = std::variant<JobRecord, JobEndRecord, BindRecord, ResultRecord, FailureRecord>;

// What the coordinator must not forget, in one SQLite file: jobs, failures, the cache of results by
// digest, and the catalogue. One connection, exclusively locked for as long as the journal lives;
// WAL, synchronous=FULL. Any thread may call anything. Every member may throw
// core::Error(kUnavailable) when the file cannot be read or written; after a failed write all
// further ones fail too, because memory is then ahead of the disk: the process must end and start
// again from what the file holds.
class Journal {
 public:
  using Ticket = std::uint64_t;

  // Opens or creates the file and counts the start. Throws core::Error(kFailedPrecondition) when
  // another process has it open or it was written by a newer program.
  explicit Journal(const std::filesystem::path& file);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;
  Journal(Journal&&) = delete;
  Journal& operator=(Journal&&) = delete;

  // Counts the times the file was opened, from 1.
  [[nodiscard]] std::uint32_t epoch() const;

  // Queues records for the next group commit, in order and all or nothing. Lookups see them at
  // once; they and all earlier ones are durable when wait(ticket) has returned.
  Ticket append(std::vector<Record> records);
  void wait(Ticket ticket);

  // Unfinished jobs in the order of submission, then the last `ended_limit` ended ones.
  [[nodiscard]] std::vector<JobRecord> jobs(std::size_t ended_limit);
  [[nodiscard]] std::optional<JobRecord> job_of_request(const std::string& request_id);

  // The result of each shard's work, where known.
  [[nodiscard]] std::vector<std::optional<core::Digest>> results_of(
      std::span<const core::Digest> shards);
  // Forgets all shards whose result this is, and says how many.
  std::uint64_t forget_result(const core::Digest& result);
  [[nodiscard]] std::vector<FailureRecord> failures_of(const std::string& job, StageName stage);

  // The catalogue's part of the same file.
  [[nodiscard]] JournalCatalogue& catalogue();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::coordinator
