#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "core/digest.h"
#include "worker/attempt_table.h"

namespace weft::worker {

// A result that has been computed and not yet been stored with the coordinator.
struct OutboxItem {
  ShardClaim claim;
  core::Digest digest;
  std::string bytes;
};

// Results on their way to the coordinator. While it is away they gather here, so that computing
// goes on, until the limit is reached. Any thread.
class Outbox {
 public:
  explicit Outbox(std::uint64_t limit_bytes) : limit_bytes_(limit_bytes) {}

  // Waits while the outbox is full. False when it is closed; the item is then dropped.
  bool push(OutboxItem item);
  // Waits for an item; nothing when the outbox is closed and empty.
  [[nodiscard]] std::optional<OutboxItem> pop();
  void close();

 private:
  std::uint64_t limit_bytes_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<OutboxItem> items_;
  std::uint64_t total_bytes_ = 0;
  bool is_closed_ = false;
};

}  // namespace weft::worker
