#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/resource_use.h"

namespace weft::core {

namespace {

// The indices while threads share them out.
class Deal {
 public:
  Deal(std::size_t count, const std::function<void(std::size_t)>& work)
      : end_(count), work_(work) {}

  // What one thread does of them.
  void take_part() noexcept {
    for (std::size_t i = next_++; i < end_; i = next_++) {
      try {
        work_(i);
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (i < end_) {
          failure_ = std::current_exception();
          end_ = i;  // what lies before is still done: it may fail, too
        }
      }
    }
  }

  // REQUIRES: all threads are done.
  void rethrow() const {
    if (failure_) {
      std::rethrow_exception(failure_);
    }
  }

 private:
  std::atomic<std::size_t> end_;
  const std::function<void(std::size_t)>& work_;
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
  std::exception_ptr failure_;
};

}  // namespace

void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 unsigned most_threads) {
  Deal deal(count, work);
  const unsigned cores =
      most_threads == kAllCores ? std::max(1U, std::thread::hardware_concurrency()) : most_threads;
  const std::size_t threads = std::min<std::size_t>(cores, count);
  std::atomic<double> helpers_cpu_seconds{0};
  {
    std::vector<std::jthread> others;
    try {
      while (others.size() + 1 < threads) {
        others.emplace_back([&] {
          deal.take_part();
          helpers_cpu_seconds += thread_cpu_seconds();
        });
      }
    } catch (const std::system_error&) {
      // There are as many threads as the system gives.
    }
    deal.take_part();
  }
  add_thread_cpu_seconds(helpers_cpu_seconds);
  deal.rethrow();
}

}  // namespace weft::core
