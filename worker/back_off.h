#pragma once

#include <chrono>
#include <functional>
#include <random>

namespace weft::worker {

// Waits between tries, each time about twice as long, from 0.1 to 5 seconds (or `longest`), give or
// take a quarter, so that the workers of a coordinator that comes back do not all call at once.
class BackOff {
 public:
  explicit BackOff(std::chrono::milliseconds longest = kLongest) : longest_(longest) {}

  // Returns early when `should_stop` says so.
  void wait(const std::function<bool()>& should_stop);
  void reset() { next_ = kFirst; }
  void limit(std::chrono::milliseconds longest) { longest_ = longest; }

 private:
  static constexpr std::chrono::milliseconds kFirst{100};
  static constexpr std::chrono::milliseconds kLongest{5000};

  std::chrono::milliseconds longest_;
  std::chrono::milliseconds next_ = kFirst;
  std::minstd_rand random_{std::random_device{}()};  // of waiting times only, never of results
};

}  // namespace weft::worker
