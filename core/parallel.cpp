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

  // Threads that take part beside the caller, so that there are `threads` together, or as many as
  // the system gives.
  [[nodiscard]] std::vector<std::jthread> helpers(std::size_t threads) {
    std::vector<std::jthread> helpers;
    try {
      while (helpers.size() + 1 < threads) {
        helpers.emplace_back([this] {
          take_part();
          helpers_cpu_seconds_ += thread_cpu_seconds();
        });
      }
    } catch (const std::system_error&) {
      // The caller takes the larger part.
    }
    return helpers;
  }

  // REQUIRES: all threads are done.
  void end() const {
    add_thread_cpu_seconds(helpers_cpu_seconds_);
    if (failure_) {
      std::rethrow_exception(failure_);
    }
  }

 private:
  std::atomic<std::size_t> end_;
  const std::function<void(std::size_t)>& work_;
  std::atomic<std::size_t> next_{0};
  std::atomic<double> helpers_cpu_seconds_{0};
  std::mutex mutex_;
  std::exception_ptr failure_;
};

}  // namespace

void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 unsigned most_threads) {
  const unsigned cores =
      most_threads == kAllCores ? std::max(1U, std::thread::hardware_concurrency()) : most_threads;
  Deal deal(count, work);
  {
    const std::vector<std::jthread> helpers = deal.helpers(std::min<std::size_t>(cores, count));
    deal.take_part();
  }
  deal.end();
}

}  // namespace weft::core
