#include "render/node/render_queue.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <optional>

#include "core/error.h"

namespace weft::render {
namespace {

constexpr std::chrono::milliseconds kBetweenQuestions{100};

}  // namespace

void RenderQueue::Place::wait(const std::function<void(std::uint32_t)>& report,
                              const std::function<bool()>& should_stop) const {
  std::optional<std::uint32_t> reported;
  std::unique_lock lock(queue_.mutex_);
  while (true) {
    const std::list<std::string>::const_iterator at = at_;
    const auto ahead = static_cast<std::uint32_t>(std::distance(queue_.orders_.cbegin(), at));
    if (ahead != reported) {
      reported = ahead;
      lock.unlock();
      report(ahead);
      lock.lock();
      continue;  // it may have changed meanwhile
    }
    if (ahead == 0) {
      return;
    }
    queue_.changed_.wait_for(lock, kBetweenQuestions);
    lock.unlock();
    if (should_stop()) {
      throw core::Error(core::Code::kCancelled, "cancelled while waiting");
    }
    lock.lock();
  }
}

std::list<std::string>::iterator RenderQueue::join(const std::string& request_id) {
  const std::lock_guard lock(mutex_);
  if (closed_) {
    throw core::Error(core::Code::kUnavailable, "the render node is ending; ask another one");
  }
  if (std::find(orders_.begin(), orders_.end(), request_id) != orders_.end()) {
    throw core::Error(core::Code::kAlreadyExists,
                      "the order " + request_id + " is being drawn or waits already");
  }
  if (orders_.size() >= limit_) {
    throw core::Error(core::Code::kResourceExhausted,
                      "the queue is full: " + std::to_string(orders_.size()) + " of " +
                          std::to_string(limit_) + " orders; ask again later");
  }
  return orders_.insert(orders_.end(), request_id);
}

void RenderQueue::leave(std::list<std::string>::iterator at) {
  const std::lock_guard lock(mutex_);
  orders_.erase(at);
  changed_.notify_all();
}

void RenderQueue::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
}

bool RenderQueue::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

std::uint32_t RenderQueue::size() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::uint32_t>(orders_.size());
}

}  // namespace weft::render
