#include "coordinator/journal_catalogue.h"

namespace weft::coordinator {

namespace {

constexpr const char* kTables = R"sql(
CREATE TABLE IF NOT EXISTS versions(
  fabric TEXT NOT NULL, number INTEGER NOT NULL, content_digest BLOB NOT NULL,
  size_bytes INTEGER NOT NULL, file TEXT NOT NULL, job TEXT NOT NULL, comment TEXT NOT NULL,
  published_at_ms INTEGER NOT NULL, PRIMARY KEY(fabric, number)) WITHOUT ROWID;
)sql";

constexpr const char* kVersionColumns =
    "fabric, number, content_digest, size_bytes, file, job, comment, published_at_ms";

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
  return version;
}

std::vector<VersionRecord> versions_of(Statement& s) {
  std::vector<VersionRecord> versions;
  while (s.step()) {
    versions.push_back(version_of(s));
  }
  return versions;
}

}  // namespace

void JournalCatalogue::create_tables(Connection& connection) { connection.run(kTables); }

void JournalCatalogue::add_version(const VersionRecord& version) {
  const std::lock_guard lock(connection_mutex_);
  Statement(connection_, ("INSERT INTO versions(" + std::string(kVersionColumns) +
                          ") VALUES(?, ?, ?, ?, ?, ?, ?, ?)")
                             .c_str())
      .text(version.fabric)
      .number(version.number)
      .blob(version.content_digest.binary())
      .number(version.size_bytes)
      .text(version.file)
      .text(version.job)
      .text(version.comment)
      .number(static_cast<std::uint64_t>(version.published_at_ms))
      .step();
}

std::vector<VersionRecord> JournalCatalogue::latest_versions() {
  const std::lock_guard lock(connection_mutex_);
  Statement s(connection_, ("SELECT " + std::string(kVersionColumns) +
                            " FROM versions v WHERE number = (SELECT MAX(number) FROM versions w "
                            "WHERE w.fabric = v.fabric) ORDER BY fabric")
                               .c_str());
  return versions_of(s);
}

std::vector<VersionRecord> JournalCatalogue::versions(const std::string& fabric) {
  const std::lock_guard lock(connection_mutex_);
  Statement s(connection_, ("SELECT " + std::string(kVersionColumns) +
                            " FROM versions WHERE fabric = ? ORDER BY number DESC")
                               .c_str());
  s.text(fabric);
  return versions_of(s);
}

}  // namespace weft::coordinator
