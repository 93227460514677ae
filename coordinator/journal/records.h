#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "coordinator/journal/journal.h"
#include "coordinator/journal/sqlite.h"

namespace weft::coordinator {

// Writes records into the journal's tables and prunes them by the rule that journal.h states. Used
// by one thread at a time. What fails throws as Connection does.
class RecordWriter {
 public:
  // Counts what is there. REQUIRES: the connection's tables are made, and it outlives this.
  explicit RecordWriter(Connection& connection);

  // REQUIRES: a transaction is open.
  void write(const Record& record);

 private:
  void put(const JobRecord& job);
  void put(const JobEndRecord& end);
  void put(const RetryRecord& retry);
  void put(const PauseRecord& pause);
  void put(const PriorityRecord& priority);
  void put(const DrainRecord& drain);
  void put(const OrderRecord& order);
  void put(const BindRecord& bind);
  void put(const ResultRecord& result);
  void put(const ResultDropRecord& drop);
  void put(const AuditRecord& audit);
  void put(const FailureRecord& failure);
  void put(const FailuresDropRecord& drop);
  void put(const BlockRecord& block);
  void put(const AttemptRecord& attempt);
  void put(const AttemptEndRecord& end);
  void put(const MismatchRecord& mismatch);
  void take_up(const AttemptRecord& attempt);
  void forget_failures(const std::string& job);
  void forget_mismatches(const std::string& job);
  void prune_attempts(const std::string& job);
  void prune_jobs();

  Connection& connection_;
  std::unordered_map<std::string, std::uint64_t> ended_attempts_;  // in the file, by job
  std::uint64_t ends_since_pruning_ = 0;
};

}  // namespace weft::coordinator
