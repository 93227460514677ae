#pragma once

#include <atomic>
#include <functional>
#include <utility>

#include "core/clock.h"

namespace weft::render {

// A question that everyone may ask as often as he likes, because it is passed on every 10 ms at
// most: whether gRPC's call was cancelled takes locks and tens of microseconds, and integrators ask
// it at every pixel. Once the answer was yes, it stays so. Any thread may ask.
class DearQuestion {
 public:
  explicit DearQuestion(std::function<bool()> ask) : ask_(std::move(ask)) {}

  [[nodiscard]] bool operator()() {
    const double now_s = since_start_.seconds();
    double due_s = due_s_.load(std::memory_order_relaxed);
    if (!answer_ && now_s >= due_s &&
        due_s_.compare_exchange_strong(due_s, now_s + kBetweenSeconds) && ask_()) {
      answer_ = true;
    }
    return answer_;
  }

 private:
  static constexpr double kBetweenSeconds = 0.01;

  std::function<bool()> ask_;
  core::Stopwatch since_start_;
  std::atomic<double> due_s_{0};
  std::atomic<bool> answer_{false};
};

}  // namespace weft::render
