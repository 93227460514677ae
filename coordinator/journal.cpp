#include "coordinator/journal.h"

#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>

#include "coordinator/sqlite.h"
#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::int64_t kSchema = 1;

constexpr const char* kTables = R"sql(
CREATE TABLE IF NOT EXISTS meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS jobs(
  position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE,
  request_id TEXT NOT NULL UNIQUE, fabric TEXT NOT NULL, description BLOB NOT NULL,
  comment TEXT NOT NULL, fingerprint BLOB, submitted_at_ms INTEGER NOT NULL,
  ended_at_ms INTEGER NOT NULL, summary BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS results(
  shard BLOB PRIMARY KEY, result BLOB NOT NULL, size_bytes INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS results_by_result ON results(result);
CREATE TABLE IF NOT EXISTS failures(
  job TEXT NOT NULL, stage INTEGER NOT NULL, shard INTEGER NOT NULL, worker TEXT NOT NULL,
  message TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS failures_by_job ON failures(job, stage);
)sql";

void write(Connection& c, const JobRecord& job) {
  Statement s(c,
              "INSERT INTO jobs(id, request_id, fabric, description, comment, fingerprint, "
              "submitted_at_ms, ended_at_ms, summary) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)");
  s.text(job.id).text(job.request_id).text(job.fabric).blob(job.description).text(job.comment);
  if (job.fingerprint) {
    s.blob(job.fingerprint->binary());
  } else {
    s.null();
  }
  s.number(static_cast<std::uint64_t>(job.submitted_at_ms))
      .number(static_cast<std::uint64_t>(job.ended_at_ms))
      .blob(job.summary)
      .step();
}

void write(Connection& c, const JobEndRecord& end) {
  Statement(c, "UPDATE jobs SET ended_at_ms = ?, summary = ? WHERE id = ?")
      .number(static_cast<std::uint64_t>(end.ended_at_ms))
      .blob(end.summary)
      .text(end.job)
      .step();
}

void write(Connection& c, const BindRecord& bind) {
  Statement(c, "UPDATE jobs SET fingerprint = ? WHERE id = ?")
      .blob(bind.fingerprint.binary())
      .text(bind.job)
      .step();
}

void write(Connection& c, const ResultRecord& result) {
  Statement(c, "INSERT OR REPLACE INTO results(shard, result, size_bytes) VALUES(?, ?, ?)")
      .blob(result.shard.binary())
      .blob(result.result.binary())
      .number(result.size_bytes)
      .step();
}

void write(Connection& c, const FailureRecord& failure) {
  Statement(c, "INSERT INTO failures(job, stage, shard, worker, message) VALUES(?, ?, ?, ?, ?)")
      .text(failure.job)
      .number(static_cast<std::uint64_t>(failure.stage))
      .number(failure.shard)
      .text(failure.worker)
      .text(failure.message)
      .step();
}

constexpr const char* kJobColumns =
    "id, request_id, fabric, description, comment, fingerprint, submitted_at_ms, ended_at_ms, "
    "summary";

JobRecord job_of(const Statement& s) {
  JobRecord job;
  job.id = s.bytes_of(0);
  job.request_id = s.bytes_of(1);
  job.fabric = s.bytes_of(2);
  job.description = s.bytes_of(3);
  job.comment = s.bytes_of(4);
  if (!s.bytes_of(5).empty()) {
    job.fingerprint = s.digest_of(5);
  }
  job.submitted_at_ms = s.signed_of(6);
  job.ended_at_ms = s.signed_of(7);
  job.summary = s.bytes_of(8);
  return job;
}

}  // namespace

struct Journal::State {
  explicit State(const std::filesystem::path& file) : connection(file) {}

  void open();
  void commit_loop();
  void write_all(const std::vector<Record>& records);

  std::mutex connection_mutex;  // locked before `mutex` where both are
  Connection connection;
  JournalCatalogue catalogue{connection, connection_mutex};
  std::uint32_t epoch = 0;

  std::mutex mutex;  // of everything below
  std::condition_variable changed;
  std::vector<Record> waiting;
  // Results that are appended and not yet in the file; lookups see them.
  std::map<core::Digest, core::Digest> unwritten;
  Ticket appended = 0;
  Ticket durable = 0;
  std::string failure;
  bool stopping = false;
  std::thread committer;
};

void Journal::State::open() {
  connection.run(
      "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; "
      "PRAGMA synchronous=FULL; BEGIN EXCLUSIVE;");
  connection.run(kTables);
  JournalCatalogue::create_tables(connection);
  Statement schema(connection, "SELECT value FROM meta WHERE key = 'schema'");
  if (schema.step() && schema.signed_of(0) != kSchema) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "the journal has schema " + std::to_string(schema.signed_of(0)) +
                          ", this program knows schema " + std::to_string(kSchema) +
                          "; use the program that wrote it, or another state folder");
  }
  schema.reset();
  Statement(connection, "INSERT OR IGNORE INTO meta VALUES('schema', ?), ('epoch', 0)")
      .number(kSchema)
      .step();
  connection.run("UPDATE meta SET value = value + 1 WHERE key = 'epoch'");
  Statement counted(connection, "SELECT value FROM meta WHERE key = 'epoch'");
  counted.step();
  epoch = static_cast<std::uint32_t>(counted.number_of(0));
  counted.reset();
  connection.run("COMMIT");
}

void Journal::State::write_all(const std::vector<Record>& records) {
  const std::lock_guard lock(connection_mutex);
  connection.run("BEGIN IMMEDIATE");
  for (const Record& record : records) {
    std::visit([&](const auto& r) { write(connection, r); }, record);
  }
  connection.run("COMMIT");
}

// Group commit: while one transaction is being synced, the next one's records gather.
void Journal::State::commit_loop() {
  std::unique_lock lock(mutex);
  for (;;) {
    changed.wait(lock, [&] { return stopping || !waiting.empty(); });
    if (waiting.empty()) {
      return;
    }
    const std::vector<Record> records = std::move(waiting);
    waiting.clear();
    const Ticket ticket = appended;
    lock.unlock();
    std::string problem;
    try {
      write_all(records);
    } catch (const core::Error& error) {
      problem = error.what();
    }
    lock.lock();
    if (!problem.empty()) {
      failure = problem;
      changed.notify_all();
      return;
    }
    durable = ticket;
    for (const Record& record : records) {
      const auto* const result = std::get_if<ResultRecord>(&record);
      if (result != nullptr) {
        unwritten.erase(result->shard);
      }
    }
    changed.notify_all();
  }
}

Journal::Journal(const std::filesystem::path& file) : state_(std::make_unique<State>(file)) {
  state_->open();
  state_->committer = std::thread([this] { state_->commit_loop(); });
}

Journal::~Journal() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->stopping = true;
  }
  state_->changed.notify_all();
  state_->committer.join();
}

std::uint32_t Journal::epoch() const { return state_->epoch; }

Journal::Ticket Journal::append(std::vector<Record> records) {
  const std::lock_guard lock(state_->mutex);
  if (!state_->failure.empty()) {
    throw core::Error(core::Code::kUnavailable, state_->failure);
  }
  if (records.empty()) {
    return state_->appended;  // what the caller knows may rest on records that are not durable yet
  }
  for (Record& record : records) {
    const auto* const result = std::get_if<ResultRecord>(&record);
    if (result != nullptr) {
      state_->unwritten[result->shard] = result->result;
    }
    state_->waiting.push_back(std::move(record));
  }
  state_->changed.notify_all();
  return ++state_->appended;
}

void Journal::wait(Ticket ticket) {
  std::unique_lock lock(state_->mutex);
  state_->changed.wait(lock, [&] { return state_->durable >= ticket || !state_->failure.empty(); });
  if (state_->durable < ticket) {
    throw core::Error(core::Code::kUnavailable, state_->failure);
  }
}

std::vector<JobRecord> Journal::jobs(std::size_t ended_limit) {
  const std::lock_guard lock(state_->connection_mutex);
  std::vector<JobRecord> jobs;
  const std::string columns = kJobColumns;
  Statement unfinished(
      state_->connection,
      ("SELECT " + columns + " FROM jobs WHERE ended_at_ms = 0 ORDER BY position").c_str());
  while (unfinished.step()) {
    jobs.push_back(job_of(unfinished));
  }
  Statement ended(
      state_->connection,
      ("SELECT " + columns + " FROM jobs WHERE ended_at_ms <> 0 ORDER BY position DESC LIMIT ?")
          .c_str());
  ended.number(ended_limit);
  while (ended.step()) {
    jobs.push_back(job_of(ended));
  }
  return jobs;
}

std::optional<JobRecord> Journal::job_of_request(const std::string& request_id) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection,
              ("SELECT " + std::string(kJobColumns) + " FROM jobs WHERE request_id = ?").c_str());
  return s.text(request_id).step() ? std::optional(job_of(s)) : std::nullopt;
}

std::vector<std::optional<core::Digest>> Journal::results_of(std::span<const core::Digest> shards) {
  std::vector<std::optional<core::Digest>> results(shards.size());
  // Both locks: what is no longer unwritten is in the file.
  const std::lock_guard connection_lock(state_->connection_mutex);
  const std::lock_guard lock(state_->mutex);
  Statement s(state_->connection, "SELECT result FROM results WHERE shard = ?");
  for (std::size_t i = 0; i < shards.size(); ++i) {
    const auto unwritten = state_->unwritten.find(shards[i]);
    if (unwritten != state_->unwritten.end()) {
      results[i] = unwritten->second;
      continue;
    }
    if (s.blob(shards[i].binary()).step()) {
      results[i] = s.digest_of(0);
    }
    s.reset();
  }
  return results;
}

std::uint64_t Journal::forget_result(const core::Digest& result) {
  wait(append({}));
  const std::lock_guard lock(state_->connection_mutex);
  Statement(state_->connection, "DELETE FROM results WHERE result = ?")
      .blob(result.binary())
      .step();
  return state_->connection.changed_rows();
}

std::vector<FailureRecord> Journal::failures_of(const std::string& job, StageName stage) {
  const std::lock_guard lock(state_->connection_mutex);
  Statement s(state_->connection,
              "SELECT shard, worker, message FROM failures WHERE job = ? AND stage = ?");
  s.text(job).number(static_cast<std::uint64_t>(stage));
  std::vector<FailureRecord> failures;
  while (s.step()) {
    failures.push_back(
        {job, stage, s.number_of(0), s.bytes_of(1), s.bytes_of(2), TroubleKind::kFailed});
  }
  return failures;
}

JournalCatalogue& Journal::catalogue() { return state_->catalogue; }

}  // namespace weft::coordinator
