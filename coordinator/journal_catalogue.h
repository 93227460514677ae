#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "coordinator/sqlite.h"
#include "core/digest.h"

namespace weft::coordinator {

// A published version of a fabric.
struct VersionRecord {
  std::string fabric;
  std::uint64_t number = 0;
  core::Digest content_digest;
  std::uint64_t size_bytes = 0;
  std::string file;  // its name in the versions folder
  std::string job;
  std::string comment;
  std::int64_t published_at_ms = 0;
};

// The catalogue's tables in the journal's file. Any thread may call anything. Every member may
// throw core::Error(kUnavailable) when the file cannot be read or written.
class JournalCatalogue {
 public:
  // Makes the tables that are missing, inside the transaction in which the journal is opened.
  static void create_tables(Connection& connection);

  // Both belong to the journal, and outlive this.
  JournalCatalogue(Connection& connection, std::mutex& connection_mutex)
      : connection_(connection), connection_mutex_(connection_mutex) {}

  // Puts a version into the catalogue; durable on return. Throws core::Error(kAlreadyExists) when
  // that number is taken.
  void add_version(const VersionRecord& version);
  [[nodiscard]] std::vector<VersionRecord> latest_versions();  // one of each fabric, by name
  [[nodiscard]] std::vector<VersionRecord> versions(const std::string& fabric);  // newest first

 private:
  Connection& connection_;
  std::mutex& connection_mutex_;
};

}  // namespace weft::coordinator
