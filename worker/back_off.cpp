#include "worker/back_off.h"

#include <algorithm>
#include <thread>

#include "core/clock.h"

namespace weft::worker {

void BackOff::wait(const std::function<bool()>& should_stop) {
  constexpr std::chrono::milliseconds kStep{20};
  const double factor = std::uniform_real_distribution<double>(0.75, 1.25)(random_);
  const double seconds = std::chrono::duration<double>(std::min(next_, longest_)).count() * factor;
  next_ = std::min(next_ * 2, kLongest);
  const core::Stopwatch since_start;
  while (since_start.seconds() < seconds && !should_stop()) {
    std::this_thread::sleep_for(kStep);
  }
}

}  // namespace weft::worker
