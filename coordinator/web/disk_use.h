#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>

#include "coordinator/scheduler/scheduler.h"

namespace weft::coordinator {

// How much the coordinator's stores hold. Counting walks through their folders, so it is done in a
// thread of its own, when somebody asks and the last count is some minutes old. Any thread.
class DiskUse {
 public:
  // `scheduler` must outlive it.
  explicit DiskUse(Scheduler& scheduler) : scheduler_(scheduler) {}
  ~DiskUse();
  DiskUse(const DiskUse&) = delete;
  DiskUse& operator=(const DiskUse&) = delete;
  DiskUse(DiskUse&&) = delete;
  DiskUse& operator=(DiskUse&&) = delete;

  struct Bytes {
    std::uint64_t results = 0;  // blobs that jobs computed
    std::uint64_t pieces = 0;   // of published versions
    std::uint64_t trash = 0;    // of both
  };
  // The last count; nothing before the first one is done.
  [[nodiscard]] std::optional<Bytes> latest();

 private:
  void count();

  Scheduler& scheduler_;
  std::atomic<bool> is_ending_ = false;
  std::mutex mutex_;  // guards all below
  bool is_counting_ = false;
  std::optional<Bytes> bytes_;
  std::optional<core::Stopwatch> since_count_;
  std::thread thread_;
};

}  // namespace weft::coordinator
