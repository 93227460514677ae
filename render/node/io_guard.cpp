#include "render/node/io_guard.h"

#include <chrono>
#include <utility>

namespace weft::render {
namespace {

constexpr std::chrono::seconds kIoLimit{60};  // stated in render.proto

}  // namespace

IoGuard::IoGuard(std::function<void()> end) : end_(std::move(end)), watcher_([this] { watch(); }) {}

IoGuard::~IoGuard() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
  }
  watcher_.join();
}

void IoGuard::begin() {
  const std::lock_guard lock(mutex_);
  ++begun_;
  changed_.notify_all();
}

void IoGuard::finish() {
  const std::lock_guard lock(mutex_);
  ++finished_;
  changed_.notify_all();
}

void IoGuard::watch() {
  std::unique_lock lock(mutex_);
  while (!over_) {
    if (begun_ == finished_) {
      changed_.wait(lock, [&] { return over_ || begun_ != finished_; });
      continue;
    }
    const std::uint64_t seen = finished_;
    if (!changed_.wait_for(lock, kIoLimit, [&] { return over_ || finished_ != seen; })) {
      end_();
      changed_.wait(lock, [&] { return over_; });
    }
  }
}

}  // namespace weft::render
