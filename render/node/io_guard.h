#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace weft::render {

// Watches the reads and writes of one call: when one of them takes longer than a minute, the other
// end does not move, and the call is ended. Any thread may call.
class IoGuard {
 public:
  // `end` ends the call, so that a read or write under way fails; called at most once.
  explicit IoGuard(std::function<void()> end);
  ~IoGuard();
  IoGuard(const IoGuard&) = delete;
  IoGuard& operator=(const IoGuard&) = delete;
  IoGuard(IoGuard&&) = delete;
  IoGuard& operator=(IoGuard&&) = delete;

  // Runs one read or write.
  template <class Io>
  bool run(Io&& io) {
    begin();
    const bool done = io();
    finish();
    return done;
  }

 private:
  void begin();
  void finish();
  void watch();

  std::function<void()> end_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t begun_ = 0;
  std::uint64_t finished_ = 0;
  bool over_ = false;
  std::thread watcher_;
};

}  // namespace weft::render
