#pragma once

#include <chrono>
#include <functional>
#include <random>

namespace weft::worker {

// Waits between tries, each time about twice as long, from 0.1 to 5 seconds, give or take a
// quarter, so that the workers of a coordinator that comes back do not all call at once.
class BackOff {
 public:
  // Returns early when `should_stop` says so.
  void wait(const std::function<bool()>& should_stop);
  void reset() { next_ = kFirst; }

 private:
  static constexpr std::chrono::milliseconds kFirst{100};
  static constexpr std::chrono::milliseconds kLongest{5000};

  std::chrono::milliseconds next_ = kFirst;
  std::minstd_rand random_{std::random_device{}()};  // of waiting times only, never of results
};

}  // namespace weft::worker
