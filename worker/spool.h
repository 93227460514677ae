#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/digest.h"
#include "worker/attempt_table.h"
#include "worker/spool_folder.h"

namespace weft::worker {

// A result that the coordinator does not have yet.
struct SpoolItem {
  ShardClaim claim;
  SpoolFolder* folder = nullptr;  // of the spool
  std::uint64_t number = 0;       // of the attempt in the folder
  SpoolFolder::Result result;
};

// What was computed and is not acknowledged, in the scratch folder: the bytes of a result until the
// coordinator has stored them, the names of an attempt's results until its completion is
// acknowledged. So nothing that was computed is lost with this process: whoever comes next on the
// folder takes it over. Any thread.
class Spool {
 public:
  // Results of `limit_bytes` in all wait at a time, and one more. Throws core::Error(kUnavailable)
  // when root/name cannot be made.
  Spool(const std::filesystem::path& root, const std::string& name, std::uint64_t limit_bytes);
  // Removes what is empty; the rest is for a successor.
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;
  Spool(Spool&&) = delete;
  Spool& operator=(Spool&&) = delete;

  // Takes a result in, to be uploaded; waits while it is full. False when it was closed or
  // `should_stop` says so. Throws core::Error(kResourceExhausted) when the disk is full and
  // kUnavailable when it fails otherwise; nothing is kept then.
  bool put(const ShardClaim& claim, const core::Digest& digest, const std::string& bytes,
           const std::function<bool()>& should_stop);

  // The oldest results to upload, once one is there: those that may go in one call (see
  // cluster.proto, WriteMany), or a larger one alone. What comes within a quarter of a second goes
  // along, unless it is much or hurry() was called. Nothing once closed. For each, exactly one of
  // the three ends must follow.
  [[nodiscard]] std::vector<SpoolItem> next();
  // Nothing more will come soon.
  void hurry();
  // Its bytes. Throws core::Error(kDataLoss) when they were damaged.
  [[nodiscard]] static std::string read(const SpoolItem& item);

  // The coordinator has it: only its name is kept.
  void uploaded(const SpoolItem& item);
  // It is of no use.
  void dropped(const SpoolItem& item);
  // The process is about to end: it stays for a successor.
  void kept(const SpoolItem& item);

  // Nothing is left to say about the attempt.
  void forget(const v1::AttemptName& name);

  // Attempts of dead processes on the same root, this process's from now on. Their results are to
  // be entered with `enter`.
  struct Orphan {
    v1::Completion completion;  // names it, with the results that the coordinator has
    std::vector<SpoolItem> items;
  };
  [[nodiscard]] std::vector<Orphan> take_over();
  void enter(const SpoolItem& item);

  // Makes durable what has come since the last call and is still here.
  void sync();

  // Ends the waiting of all others.
  void close();

 private:
  using Name = std::pair<std::string, std::uint64_t>;  // job, attempt
  struct Entry {
    SpoolFolder* folder = nullptr;
    std::uint64_t number = 0;
    std::map<std::uint64_t, SpoolFolder::Result> waiting;  // by shard
  };

  Entry& entry_of(const v1::Assignment& assignment);  // REQUIRES: mutex_ is held
  void end(const SpoolItem& item, bool is_gone);
  void discard_if_empty(const SpoolFolder* folder);  // REQUIRES: mutex_ is held

  const std::filesystem::path root_;
  const std::uint64_t limit_bytes_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::unique_ptr<SpoolFolder>> folders_;  // ours, then those taken over
  std::map<Name, Entry> entries_;
  std::deque<SpoolItem> items_;
  std::vector<SpoolItem> unsynced_;
  std::uint64_t total_bytes_ = 0;
  bool is_urgent_ = false;  // what waits is not to wait for more
  std::uint64_t next_number_ = 1;
  bool is_closed_ = false;
};

}  // namespace weft::worker
