#include "worker/outbox.h"

#include <utility>

namespace weft::worker {

bool Outbox::push(OutboxItem item) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return is_closed_ || total_bytes_ < limit_bytes_; });
  if (is_closed_) {
    return false;
  }
  total_bytes_ += item.bytes.size();
  items_.push_back(std::move(item));
  changed_.notify_all();
  return true;
}

std::optional<OutboxItem> Outbox::pop() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return is_closed_ || !items_.empty(); });
  if (items_.empty()) {
    return std::nullopt;
  }
  OutboxItem item = std::move(items_.front());
  items_.pop_front();
  total_bytes_ -= item.bytes.size();
  changed_.notify_all();
  return item;
}

void Outbox::close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  changed_.notify_all();
}

}  // namespace weft::worker
