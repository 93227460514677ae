#include "coordinator/journal/schema.h"

#include <string>

#include "coordinator/journal/catalogue_tables.h"
#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::int64_t kSchema = 3;

constexpr const char* kTables = R"sql(
CREATE TABLE IF NOT EXISTS meta(key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS jobs(
  position INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE,
  request_id TEXT NOT NULL UNIQUE, fabric TEXT NOT NULL, description BLOB NOT NULL,
  comment TEXT NOT NULL, fingerprint BLOB, submitted_at_ms INTEGER NOT NULL,
  ended_at_ms INTEGER NOT NULL, summary BLOB NOT NULL,
  user TEXT NOT NULL DEFAULT 'nobody', priority INTEGER NOT NULL DEFAULT 0,
  audit REAL NOT NULL DEFAULT 0, labels TEXT NOT NULL DEFAULT '',
  paused INTEGER NOT NULL DEFAULT 0, retries INTEGER NOT NULL DEFAULT 0);
CREATE INDEX IF NOT EXISTS jobs_by_end ON jobs(ended_at_ms, position);
CREATE TABLE IF NOT EXISTS results(
  shard BLOB PRIMARY KEY, result BLOB NOT NULL, size_bytes INTEGER NOT NULL,
  worker TEXT NOT NULL DEFAULT '', audited_by TEXT NOT NULL DEFAULT '') WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS results_by_result ON results(result);
CREATE TABLE IF NOT EXISTS failures(
  job TEXT NOT NULL, stage INTEGER NOT NULL, shard INTEGER NOT NULL, worker TEXT NOT NULL,
  message TEXT NOT NULL, kind INTEGER NOT NULL DEFAULT 0);
CREATE INDEX IF NOT EXISTS failures_by_job ON failures(job, stage);
CREATE TABLE IF NOT EXISTS attempts(
  job TEXT NOT NULL, attempt INTEGER NOT NULL, stage INTEGER NOT NULL,
  first_shard INTEGER NOT NULL, shards INTEGER NOT NULL, worker TEXT NOT NULL,
  worker_name TEXT NOT NULL, purpose INTEGER NOT NULL, began_at_ms INTEGER NOT NULL,
  ended_at_ms INTEGER NOT NULL DEFAULT 0, outcome INTEGER NOT NULL DEFAULT 0,
  shards_done INTEGER NOT NULL DEFAULT 0, message TEXT NOT NULL DEFAULT '',
  taken_up INTEGER NOT NULL DEFAULT 0, taken_up_at_ms INTEGER NOT NULL DEFAULT 0,
  earlier_outcome INTEGER NOT NULL DEFAULT 0, earlier_ended_at_ms INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY(job, attempt)) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS attempts_running ON attempts(job, stage) WHERE ended_at_ms = 0;
CREATE TABLE IF NOT EXISTS blocks(
  worker TEXT NOT NULL, stage INTEGER NOT NULL, liar INTEGER NOT NULL,
  PRIMARY KEY(worker, stage)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS drains(worker TEXT PRIMARY KEY) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS mismatches(
  job TEXT NOT NULL, stage INTEGER NOT NULL, shard INTEGER NOT NULL, worker TEXT NOT NULL,
  result BLOB NOT NULL, other_worker TEXT NOT NULL, other_result BLOB NOT NULL,
  liar TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS mismatches_by_job ON mismatches(job, stage, shard);
CREATE TABLE IF NOT EXISTS orders(
  position INTEGER PRIMARY KEY AUTOINCREMENT, request_id TEXT NOT NULL UNIQUE);
)sql";

// Schema 1 knew neither users nor attempts. The tables that it lacked are made as in a new file.
constexpr const char* kFromSchema1 = R"sql(
ALTER TABLE jobs ADD COLUMN user TEXT NOT NULL DEFAULT 'nobody';
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN audit REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN labels TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN retries INTEGER NOT NULL DEFAULT 0;
ALTER TABLE results ADD COLUMN worker TEXT NOT NULL DEFAULT '';
ALTER TABLE results ADD COLUMN audited_by TEXT NOT NULL DEFAULT '';
ALTER TABLE failures ADD COLUMN kind INTEGER NOT NULL DEFAULT 0;
)sql";

// Schema 2 did not keep how an attempt had ended that was taken up again.
constexpr const char* kFromSchema2 = R"sql(
ALTER TABLE attempts ADD COLUMN taken_up INTEGER NOT NULL DEFAULT 0;
ALTER TABLE attempts ADD COLUMN taken_up_at_ms INTEGER NOT NULL DEFAULT 0;
ALTER TABLE attempts ADD COLUMN earlier_outcome INTEGER NOT NULL DEFAULT 0;
ALTER TABLE attempts ADD COLUMN earlier_ended_at_ms INTEGER NOT NULL DEFAULT 0;
)sql";

// 0: a new file.
std::int64_t schema_of(Connection& connection) {
  Statement has_meta(connection, "SELECT 1 FROM sqlite_schema WHERE name = 'meta'");
  if (!has_meta.step()) {
    return 0;
  }
  Statement schema(connection, "SELECT value FROM meta WHERE key = 'schema'");
  return schema.step() ? schema.signed_of(0) : 0;
}

}  // namespace

void make_schema(Connection& connection) {
  const std::int64_t schema = schema_of(connection);
  if (schema > kSchema || schema < 0) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "the journal has schema " + std::to_string(schema) +
                          ", this program knows schema " + std::to_string(kSchema) +
                          "; use the program that wrote it, or another state folder");
  }
  if (schema == 1) {
    connection.run(kFromSchema1);
  } else if (schema == 2) {
    connection.run(kFromSchema2);
  }
  connection.run(kTables);
  JournalCatalogue::create_tables(connection);
  connection.run("INSERT OR IGNORE INTO meta VALUES('epoch', 0)");
  Statement(connection, "INSERT OR REPLACE INTO meta VALUES('schema', ?)").number(kSchema).step();
}

}  // namespace weft::coordinator
