#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "coordinator/journal/sqlite.h"
#include "core/digest.h"
#include "storage/pieces.h"

namespace weft::coordinator {

// A published version of a fabric.
struct VersionRecord {
  std::string fabric;
  std::uint64_t number = 0;
  core::Digest content_digest;
  std::uint64_t size_bytes = 0;
  std::string file;  // what the whole file is called
  std::string job;
  std::string comment;
  std::int64_t published_at_ms = 0;
  std::uint64_t parent = 0;        // the number that was the latest before; 0: none
  std::uint64_t shared_bytes = 0;  // of its pieces, those that were there before
  std::uint64_t cached_shards = 0;
  std::uint64_t computed_shards = 0;
  std::string user;
  std::vector<std::string> tags;  // sorted
  std::string carried_over_from;  // "silk@3", whose light it has; empty: its own was traced
};

// One step of a fabric's history.
struct HistoryRecord {
  std::string fabric;
  std::int64_t at_ms = 0;
  std::string action;  // published, tagged, untagged, rolled_back
  std::uint64_t number = 0;
  std::string tag;
  std::string user;
  std::string comment;
  std::string request_id;  // of the call; empty: none
};

// What remaking a version's file needs to know of its job.
struct JobOrigin {
  std::string description;  // canonical bytes
  core::Digest fingerprint;
};

// The catalogue's tables in the journal's file. Any thread may call anything; what changes
// something is one transaction, durable on return. Every member may throw
// core::Error(kUnavailable) when the file cannot be read or written.
class JournalCatalogue {
 public:
  // Makes the tables that are missing, inside the transaction in which the journal is opened.
  static void create_tables(Connection& connection);

  // Both belong to the journal, and outlive this.
  JournalCatalogue(Connection& connection, std::mutex& connection_mutex)
      : connection_(connection), connection_mutex_(connection_mutex) {}

  // Puts a version into the catalogue, with its pieces and the results it was made from, and makes
  // it the latest. The step is recorded with `request_id`, which may be empty. Throws
  // core::Error(kAlreadyExists) when that number is taken.
  void publish(const VersionRecord& version, const std::vector<storage::Piece>& pieces,
               const std::vector<core::Digest>& results, const std::string& request_id);

  [[nodiscard]] std::vector<VersionRecord> latest_versions();  // one of each fabric, by name
  [[nodiscard]] std::vector<VersionRecord> versions(const std::string& fabric);  // newest first
  // The number that NAME@latest means; 0 when there is no such fabric.
  [[nodiscard]] std::uint64_t latest_number(const std::string& fabric);

  // Nothing for a version that is kept as a whole file (of an older weft).
  [[nodiscard]] std::optional<std::vector<storage::Piece>> pieces_of(const std::string& fabric,
                                                                     std::uint64_t number);
  void set_pieces(const std::string& fabric, std::uint64_t number,
                  const std::vector<storage::Piece>& pieces);
  // Calls for every version that is kept in pieces.
  using VisitPieces = std::function<void(const std::string& fabric, std::uint64_t number,
                                         const std::vector<storage::Piece>& pieces)>;
  void visit_pieces(const VisitPieces& visit);
  // Results that some version was made from.
  [[nodiscard]] std::set<core::Digest> published_results();

  // The next three record `step` too, unless one of its request_id is recorded: then they change
  // nothing. REQUIRES: the version exists.
  void set_tag(const HistoryRecord& step);     // step.tag names step.number from now on
  void remove_tag(const HistoryRecord& step);  // step.tag names nothing from now on
  void set_latest(const HistoryRecord& step);  // step.number is the latest
  [[nodiscard]] std::vector<HistoryRecord> history(const std::string& fabric, std::size_t limit);
  [[nodiscard]] std::optional<HistoryRecord> step_of_request(const std::string& request_id);

  [[nodiscard]] std::optional<JobOrigin> job_origin(const std::string& job);

 private:
  void add_step(const HistoryRecord& step);  // REQUIRES: a transaction is open
  bool is_recorded(const std::string& request_id);

  Connection& connection_;
  std::mutex& connection_mutex_;
};

}  // namespace weft::coordinator
