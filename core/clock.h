#pragma once

#include <chrono>

namespace weft::core {

// Where time comes from; nobody else calls now(). Tests bring their own.
class Clock {
 public:
  using Time = std::chrono::sys_time<std::chrono::milliseconds>;

  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  Clock(Clock&&) = delete;
  Clock& operator=(Clock&&) = delete;
  virtual ~Clock() = default;
  [[nodiscard]] virtual Time now() const = 0;
};

// The machine's clock. Lives as long as the process; any thread may call it.
[[nodiscard]] const Clock& system_clock();

// Measures how long something took, for people to read; never part of a result.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] double seconds() const;

 private:
  std::chrono::steady_clock::time_point start_;
};

}  // namespace weft::core
