#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace weft::simulation {

// Something that must never happen did.
class Violation : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Virtual time: what is to happen, in the order of its times; what has the same time happens in the
// order in which it was arranged. One thread.
class Timeline {
 public:
  using Action = std::function<void()>;

  [[nodiscard]] std::uint64_t now_ms() const { return now_ms_; }

  void after(std::uint64_t delay_ms, Action action) {
    entries_.push_back({now_ms_ + delay_ms, next_++, std::move(action)});
    std::push_heap(entries_.begin(), entries_.end(), is_later);
  }

  [[nodiscard]] bool is_empty() const { return entries_.empty(); }

  // Lets the next thing happen. REQUIRES: there is one.
  void step() {
    std::pop_heap(entries_.begin(), entries_.end(), is_later);
    const Entry entry = std::move(entries_.back());
    entries_.pop_back();
    now_ms_ = entry.at_ms;
    entry.action();
  }

 private:
  struct Entry {
    std::uint64_t at_ms = 0;
    std::uint64_t order = 0;
    Action action;
  };
  static bool is_later(const Entry& a, const Entry& b) {
    return a.at_ms != b.at_ms ? a.at_ms > b.at_ms : a.order > b.order;
  }

  std::uint64_t now_ms_ = 0;
  std::uint64_t next_ = 0;
  std::vector<Entry> entries_;
};

// What happens, for people who replay a seed.
class Trace {
 public:
  explicit Trace(bool is_on) : is_on_(is_on) {}

  template <class... Args>
  void line(const Timeline& timeline, fmt::format_string<Args...> format, Args&&... args) const {
    if (is_on_) {
      fmt::print("{:10.3f}  {}\n", static_cast<double>(timeline.now_ms()) / 1000,
                 fmt::format(format, std::forward<Args>(args)...));
    }
  }

 private:
  bool is_on_;
};

}  // namespace weft::simulation
