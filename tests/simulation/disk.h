#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/queue/events.h"
#include "core/digest.h"
#include "tests/simulation/fake_fabric.h"

// The coordinator's disk: a journal whose last groups of records may not be on it yet, and blobs.

namespace weft::simulation {

using coordinator::StageName;
using coordinator::Time;

enum class End : std::uint8_t { kNone, kSucceeded, kFailed, kCancelled };

// ---- records of the model's own, beside the queue's

struct JobRow {
  std::string id;
  FakeFabric fabric;
  coordinator::JobDemands demands;
  Time submitted_at{};
  std::uint64_t order = 0;
  std::optional<core::Digest> fingerprint;
  bool is_paused = false;
  End end = End::kNone;
  std::string error;
  std::optional<core::Digest> database;
};
struct JobEndRow {
  std::string job;
  End end = End::kNone;
  std::string error;
  std::optional<core::Digest> database;
};
struct PauseRow {
  std::string job;
  bool is_paused = false;
};
struct PriorityRow {
  std::string job;
  std::int32_t priority = 0;
};
struct DrainRow {
  std::string worker;
  bool is_drained = false;
};
struct RetryRow {
  std::string job;
};
struct ForgetRow {
  core::Digest result;
};

using Row = std::variant<JobRow, JobEndRow, PauseRow, PriorityRow, DrainRow, RetryRow, ForgetRow,
                         coordinator::BindRecord, coordinator::ResultRecord,
                         coordinator::ResultDropRecord, coordinator::AuditRecord,
                         coordinator::FailureRecord, coordinator::FailuresDropRecord,
                         coordinator::BlockRecord, coordinator::AttemptRecord,
                         coordinator::AttemptEndRecord, coordinator::MismatchRecord>;

struct KeptResult {
  core::Digest result;
  std::string worker;
  bool is_audited = false;
};

// What the rows add up to.
struct Tables {
  std::uint32_t epoch = 0;
  std::map<std::string, JobRow> jobs;
  std::map<core::Digest, KeptResult> results;  // by work
  std::vector<coordinator::FailureRecord> failures;
  std::vector<coordinator::MismatchRecord> mismatches;
  std::map<std::uint64_t, coordinator::AttemptRecord> attempts;  // that have not ended
  std::map<std::uint64_t, std::pair<coordinator::AttemptRecord, std::int64_t>> lost;  // and when
  std::map<std::pair<std::string, StageName>, bool> blocks;  // whether for lies
  std::set<std::string> drained;
  std::vector<std::pair<std::string, core::Digest>> versions;  // fabric, database

  void apply(const Row& row);
  [[nodiscard]] std::vector<coordinator::MismatchRecord> mismatches_of(
      const std::string& job) const;
};

// Rows are queued by append() and made durable group by group: begin_sync(), then end_sync().
class JournalDisk {
 public:
  // `rows` are durable all together, after those of earlier calls. Returns the ticket that
  // durable_ticket() reaches then.
  std::uint64_t append(std::vector<Row> rows);
  [[nodiscard]] std::uint64_t durable_ticket() const { return durable_ticket_; }
  [[nodiscard]] bool has_unsynced() const { return !waiting_.empty(); }
  [[nodiscard]] bool is_syncing() const { return is_syncing_; }
  void begin_sync();
  void end_sync();
  // In a transaction of its own, durable at once.
  void add_version(const std::string& fabric, const core::Digest& database);
  std::uint32_t count_start();  // the new epoch, durable at once

  // The process or the machine died. The group that was being written is there or not.
  void crash(bool keeps_group_under_way);

  // What lookups see: all that was appended.
  [[nodiscard]] const Tables& tables() const { return tables_; }
  [[nodiscard]] const Tables& durable() const { return durable_; }

 private:
  Tables tables_;
  Tables durable_;
  std::deque<std::vector<Row>> waiting_;
  std::vector<Row> under_way_;
  bool is_syncing_ = false;
  std::uint64_t last_ticket_ = 0;
  std::uint64_t ticket_under_way_ = 0;
  std::uint64_t durable_ticket_ = 0;
};

// Blobs are durable when put() returns.
class BlobDisk {
 public:
  void put(const core::Digest& digest, std::string bytes) { blobs_[digest] = std::move(bytes); }
  [[nodiscard]] bool has(const core::Digest& digest) const { return blobs_.contains(digest); }
  // A damaged blob is removed and counts as absent.
  [[nodiscard]] std::optional<std::string> get(const core::Digest& digest);
  // Damages or removes the `which`th blob, counted round and round; says which it was.
  std::optional<core::Digest> spoil(std::uint64_t which, bool removes_it);

 private:
  std::map<core::Digest, std::string> blobs_;
};

}  // namespace weft::simulation
