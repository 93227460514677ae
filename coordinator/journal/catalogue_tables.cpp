#include "coordinator/journal/catalogue_tables.h"

#include "core/error.h"

namespace weft::coordinator {

namespace {

// The first table is that of schema 1; the others hang on its rows and may lack them.
constexpr const char* kTables = R"sql(
CREATE TABLE IF NOT EXISTS versions(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, content_digest BLOB NOT NULL,
  size_bytes INTEGER NOT NULL, file TEXT NOT NULL, job TEXT NOT NULL, comment TEXT NOT NULL,
  published_at_ms INTEGER NOT NULL, PRIMARY KEY(fabric, number)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS version_facts(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, parent INTEGER NOT NULL,
  shared_bytes INTEGER NOT NULL, cached_shards INTEGER NOT NULL,
  computed_shards INTEGER NOT NULL, user TEXT NOT NULL,
  PRIMARY KEY(fabric, number)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS carried_versions(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, base TEXT NOT NULL,
  PRIMARY KEY(fabric, number)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS manifests(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, pieces BLOB NOT NULL,
  PRIMARY KEY(fabric, number));
CREATE TABLE IF NOT EXISTS published_results(result BLOB PRIMARY KEY) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS tags(
  fabric TEXT NOT NULL, tag TEXT NOT NULL, number INTEGER NOT NULL,
  PRIMARY KEY(fabric, tag)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS latest(
  fabric TEXT PRIMARY KEY, number INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS history(
  position INTEGER PRIMARY KEY AUTOINCREMENT, fabric TEXT NOT NULL, at_ms INTEGER NOT NULL,
  action TEXT NOT NULL, number INTEGER NOT NULL, tag TEXT NOT NULL, user TEXT NOT NULL,
  comment TEXT NOT NULL, request_id TEXT UNIQUE);
CREATE INDEX IF NOT EXISTS history_by_fabric ON history(fabric);
)sql";

const std::string kSelectVersions =
    "SELECT v.fabric, v.number, v.content_digest, v.size_bytes, v.file, v.job, v.comment, "
    "v.published_at_ms, f.parent, f.shared_bytes, f.cached_shards, f.computed_shards, f.user, "
    "(SELECT group_concat(tag, ' ') FROM (SELECT tag FROM tags t WHERE t.fabric = v.fabric AND "
    "t.number = v.number ORDER BY tag)), (SELECT c.base FROM carried_versions c WHERE "
    "c.fabric = v.fabric AND c.number = v.number) FROM versions v LEFT JOIN version_facts f ON "
    "f.fabric = v.fabric AND f.number = v.number ";

const std::string kLatestOfFabric =
    "COALESCE((SELECT l.number FROM latest l WHERE l.fabric = v.fabric), "
    "(SELECT MAX(w.number) FROM versions w WHERE w.fabric = v.fabric))";

const std::string kSelectHistory =
    "SELECT fabric, at_ms, action, number, tag, user, comment, request_id FROM history ";

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    words.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

VersionRecord version_of(const Statement& s) {
  VersionRecord version;
  version.fabric = s.bytes_of(0);
  version.number = s.number_of(1);
  version.content_digest = s.digest_of(2);
  version.size_bytes = s.number_of(3);
  version.file = s.bytes_of(4);
  version.job = s.bytes_of(5);
  version.comment = s.bytes_of(6);
  version.published_at_ms = s.signed_of(7);
  version.parent = s.number_of(8);
  version.shared_bytes = s.number_of(9);
  version.cached_shards = s.number_of(10);
  version.computed_shards = s.number_of(11);
  version.user = s.bytes_of(12);
  version.tags = words_of(s.bytes_of(13));
  version.carried_over_from = s.bytes_of(14);
  return version;
}

std::vector<VersionRecord> versions_of(Statement& s) {
  std::vector<VersionRecord> versions;
  while (s.step()) {
    versions.push_back(version_of(s));
  }
  return versions;
}

HistoryRecord step_of(const Statement& s) {
  return {s.bytes_of(0), s.signed_of(1), s.bytes_of(2), s.number_of(3),
          s.bytes_of(4), s.bytes_of(5),  s.bytes_of(6), s.bytes_of(7)};
}

// Undone unless it was committed.
class Transaction {
 public:
  explicit Transaction(Connection& connection) : connection_(connection) {
    connection_.run("BEGIN IMMEDIATE");
  }
  ~Transaction() {
    if (is_open_) {
      try {
        connection_.run("ROLLBACK");
      } catch (const core::Error&) {
        return;  // SQLite has rolled back by itself
      }
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  Transaction(Transaction&&) = delete;
  Transaction& operator=(Transaction&&) = delete;

  void commit() {
    connection_.run("COMMIT");
    is_open_ = false;
  }

 private:
  Connection& connection_;
  bool is_open_ = true;
};

void write_version(Connection& connection, const VersionRecord& version) {
  Statement(connection,
            "INSERT INTO versions(fabric, number, content_digest, size_bytes, file, job, comment, "
            "published_at_ms) VALUES(?, ?, ?, ?, ?, ?, ?, ?)")
      .text(version.fabric)
      .number(version.number)
      .blob(version.content_digest.binary())
      .number(version.size_bytes)
      .text(version.file)
      .text(version.job)
      .text(version.comment)
      .number(static_cast<std::uint64_t>(version.published_at_ms))
      .step();
  Statement(connection,
            "INSERT INTO version_facts(fabric, number, parent, shared_bytes, cached_shards, "
            "computed_shards, user) VALUES(?, ?, ?, ?, ?, ?, ?)")
      .text(version.fabric)
      .number(version.number)
      .number(version.parent)
      .number(version.shared_bytes)
      .number(version.cached_shards)
      .number(version.computed_shards)
      .text(version.user)
      .step();
  if (!version.carried_over_from.empty()) {
    Statement(connection, "INSERT INTO carried_versions(fabric, number, base) VALUES(?, ?, ?)")
        .text(version.fabric)
        .number(version.number)
        .text(version.carried_over_from)
        .step();
  }
}

void write_pieces(Connection& connection, const std::string& fabric, std::uint64_t number,
                  const std::vector<storage::Piece>& pieces) {
  Statement(connection, "INSERT OR REPLACE INTO manifests(fabric, number, pieces) VALUES(?, ?, ?)")
      .text(fabric)
      .number(number)
      .blob(storage::encode_pieces(pieces))
      .step();
}

void write_latest(Connection& connection, const std::string& fabric, std::uint64_t number) {
  Statement(connection, "INSERT OR REPLACE INTO latest(fabric, number) VALUES(?, ?)")
      .text(fabric)
      .number(number)
      .step();
}

}  // namespace

void JournalCatalogue::create_tables(Connection& connection) { connection.run(kTables); }

void JournalCatalogue::publish(const VersionRecord& version,
                               const std::vector<storage::Piece>& pieces,
                               const std::vector<core::Digest>& results,
                               const std::string& request_id) {
  const std::lock_guard lock(connection_mutex_);
  Transaction transaction(connection_);
  write_version(connection_, version);
  write_pieces(connection_, version.fabric, version.number, pieces);
  write_latest(connection_, version.fabric, version.number);
  add_step({version.fabric,
            version.published_at_ms,
            "published",
            version.number,
            {},
            version.user,
            version.comment,
            request_id});
  Statement insert(connection_, "INSERT OR IGNORE INTO published_results(result) VALUES(?)");
  for (const core::Digest& result : results) {
    insert.blob(result.binary()).step();
    insert.reset();
  }
  transaction.commit();
}

std::vector<VersionRecord> JournalCatalogue::latest_versions() {
  const std::lock_guard lock(connection_mutex_);
  const std::string sql =
      kSelectVersions + "WHERE v.number = " + kLatestOfFabric + " ORDER BY v.fabric";
  Statement s(connection_, sql.c_str());
  return versions_of(s);
}

std::vector<VersionRecord> JournalCatalogue::versions(const std::string& fabric) {
  const std::lock_guard lock(connection_mutex_);
  const std::string sql = kSelectVersions + "WHERE v.fabric = ? ORDER BY v.number DESC";
  Statement s(connection_, sql.c_str());
  s.text(fabric);
  return versions_of(s);
}

std::uint64_t JournalCatalogue::latest_number(const std::string& fabric) {
  const std::lock_guard lock(connection_mutex_);
  const std::string sql = "SELECT " + kLatestOfFabric + " FROM versions v WHERE v.fabric = ?";
  Statement s(connection_, sql.c_str());
  return s.text(fabric).step() ? s.number_of(0) : 0;
}

std::optional<std::vector<storage::Piece>> JournalCatalogue::pieces_of(const std::string& fabric,
                                                                       std::uint64_t number) {
  const std::lock_guard lock(connection_mutex_);
  Statement s(connection_, "SELECT pieces FROM manifests WHERE fabric = ? AND number = ?");
  if (!s.text(fabric).number(number).step()) {
    return std::nullopt;
  }
  return storage::decode_pieces(s.bytes_of(0));
}

void JournalCatalogue::set_pieces(const std::string& fabric, std::uint64_t number,
                                  const std::vector<storage::Piece>& pieces) {
  const std::lock_guard lock(connection_mutex_);
  Transaction transaction(connection_);
  write_pieces(connection_, fabric, number, pieces);
  transaction.commit();
}

void JournalCatalogue::visit_pieces(const VisitPieces& visit) {
  const std::lock_guard lock(connection_mutex_);
  Statement s(connection_, "SELECT fabric, number, pieces FROM manifests ORDER BY fabric, number");
  while (s.step()) {
    visit(s.bytes_of(0), s.number_of(1), storage::decode_pieces(s.bytes_of(2)));
  }
}

std::set<core::Digest> JournalCatalogue::published_results() {
  const std::lock_guard lock(connection_mutex_);
  std::set<core::Digest> results;
  Statement s(connection_, "SELECT result FROM published_results ORDER BY result");
  while (s.step()) {
    results.insert(results.end(), s.digest_of(0));
  }
  return results;
}

void JournalCatalogue::set_tag(const HistoryRecord& step) {
  const std::lock_guard lock(connection_mutex_);
  Transaction transaction(connection_);
  if (is_recorded(step.request_id)) {
    return;
  }
  Statement(connection_, "INSERT OR REPLACE INTO tags(fabric, tag, number) VALUES(?, ?, ?)")
      .text(step.fabric)
      .text(step.tag)
      .number(step.number)
      .step();
  add_step(step);
  transaction.commit();
}

void JournalCatalogue::remove_tag(const HistoryRecord& step) {
  const std::lock_guard lock(connection_mutex_);
  Transaction transaction(connection_);
  if (is_recorded(step.request_id)) {
    return;
  }
  Statement(connection_, "DELETE FROM tags WHERE fabric = ? AND tag = ?")
      .text(step.fabric)
      .text(step.tag)
      .step();
  add_step(step);
  transaction.commit();
}

void JournalCatalogue::set_latest(const HistoryRecord& step) {
  const std::lock_guard lock(connection_mutex_);
  Transaction transaction(connection_);
  if (is_recorded(step.request_id)) {
    return;
  }
  write_latest(connection_, step.fabric, step.number);
  add_step(step);
  transaction.commit();
}

void JournalCatalogue::add_step(const HistoryRecord& step) {
  Statement s(connection_,
              "INSERT INTO history(fabric, at_ms, action, number, tag, user, comment, request_id) "
              "VALUES(?, ?, ?, ?, ?, ?, ?, ?)");
  s.text(step.fabric)
      .number(static_cast<std::uint64_t>(step.at_ms))
      .text(step.action)
      .number(step.number)
      .text(step.tag)
      .text(step.user)
      .text(step.comment);
  if (step.request_id.empty()) {
    s.null();
  } else {
    s.text(step.request_id);
  }
  s.step();
}

bool JournalCatalogue::is_recorded(const std::string& request_id) {
  Statement s(connection_, "SELECT 1 FROM history WHERE request_id = ?");
  return !request_id.empty() && s.text(request_id).step();
}

std::vector<HistoryRecord> JournalCatalogue::history(const std::string& fabric, std::size_t limit) {
  const std::lock_guard lock(connection_mutex_);
  const std::string sql = kSelectHistory + "WHERE fabric = ? ORDER BY position DESC LIMIT ?";
  Statement s(connection_, sql.c_str());
  s.text(fabric).number(limit);
  std::vector<HistoryRecord> steps;
  while (s.step()) {
    steps.push_back(step_of(s));
  }
  return steps;
}

std::optional<HistoryRecord> JournalCatalogue::step_of_request(const std::string& request_id) {
  const std::lock_guard lock(connection_mutex_);
  const std::string sql = kSelectHistory + "WHERE request_id = ?";
  Statement s(connection_, sql.c_str());
  return s.text(request_id).step() ? std::optional(step_of(s)) : std::nullopt;
}

std::optional<JobOrigin> JournalCatalogue::job_origin(const std::string& job) {
  const std::lock_guard lock(connection_mutex_);
  Statement s(connection_, "SELECT description, fingerprint FROM jobs WHERE id = ?");
  if (!s.text(job).step() || s.bytes_of(1).empty()) {
    return std::nullopt;
  }
  return JobOrigin{s.bytes_of(0), s.digest_of(1)};
}

}  // namespace weft::coordinator
