#include "cli/end_in_time.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include <fmt/format.h>

#include "core/exit_code.h"

namespace weft::cli {

namespace {

constexpr std::chrono::milliseconds kBetweenLooks{50};

}  // namespace

EndInTime::EndInTime(const Interruption& interruption, double grace_seconds, std::string words)
    : words_(std::move(words)),
      watcher_([this, &interruption, grace_seconds] { watch(interruption, grace_seconds); }) {}

EndInTime::~EndInTime() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
    changed_.notify_all();
  }
  watcher_.join();
}

void EndInTime::watch(const Interruption& interruption, double grace_seconds) {
  std::unique_lock lock(mutex_);
  while (!interruption.requested()) {
    if (changed_.wait_for(lock, kBetweenLooks, [this] { return is_over_; })) {
      return;
    }
  }
  const std::chrono::duration<double> grace(grace_seconds);
  if (!changed_.wait_for(lock, grace, [this] { return is_over_; })) {
    fmt::print(stderr, "weft: {}\n", words_);
    std::fflush(stderr);
    std::_Exit(core::kExitFailed);
  }
}

}  // namespace weft::cli
