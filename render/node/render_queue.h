#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <string>

namespace weft::render {

// Orders that wait to be drawn, one at a time, in the order of their coming. Any thread may call.
class RenderQueue {
 public:
  // `limit`: orders being drawn and waiting, together.
  explicit RenderQueue(std::uint32_t limit) : limit_(limit) {}

  // A place in the queue, given up when it goes.
  class Place {
   public:
    ~Place() { queue_.leave(at_); }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    Place(Place&&) = delete;
    Place& operator=(Place&&) = delete;

    // Returns when it is this order's turn. `report` is called with the number of orders ahead
    // whenever that changes; `should_stop` now and then: throws core::Error(kCancelled) when it
    // says so.
    void wait(const std::function<void(std::uint32_t)>& report,
              const std::function<bool()>& should_stop) const;

   private:
    friend class RenderQueue;
    Place(RenderQueue& queue, const std::string& request_id)
        : queue_(queue), at_(queue.join(request_id)) {}
    RenderQueue& queue_;
    std::list<std::string>::iterator at_;
  };

  // Throws core::Error: kResourceExhausted when the queue is full, kAlreadyExists when the
  // request_id has a place, kUnavailable after close().
  [[nodiscard]] Place enter(const std::string& request_id) { return {*this, request_id}; }

  // Takes no more orders.
  void close();
  [[nodiscard]] bool closed() const;
  // Orders being drawn and waiting.
  [[nodiscard]] std::uint32_t size() const;
  [[nodiscard]] std::uint32_t limit() const { return limit_; }

 private:
  std::list<std::string>::iterator join(const std::string& request_id);
  void leave(std::list<std::string>::iterator at);

  const std::uint32_t limit_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::list<std::string> orders_;  // request_ids; the first is being drawn
  bool closed_ = false;
};

}  // namespace weft::render
