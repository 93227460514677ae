#include "coordinator/web/thumbnails_ahead.h"

#include <chrono>

#include <spdlog/spdlog.h>

#include "core/error.h"

namespace weft::coordinator {

namespace {

constexpr std::chrono::seconds kBetweenLooks{2};
constexpr std::chrono::seconds kBetweenTries{30};  // while the node is away or busy

bool may_pass(const core::Error& error) {
  return error.code() == core::Code::kUnavailable || error.code() == core::Code::kResourceExhausted;
}

}  // namespace

ThumbnailsAhead::ThumbnailsAhead(Catalogue& catalogue, Swatches& swatches)
    : catalogue_(catalogue), swatches_(swatches) {
  for (const VersionRecord& version : catalogue_.latest_versions()) {
    seen_[version.fabric] = version.number;
  }
  thread_ = std::thread([this] { keep_up(); });
}

ThumbnailsAhead::~ThumbnailsAhead() {
  {
    const std::lock_guard lock(mutex_);
    is_stopped_ = true;
    stopping_.notify_all();
  }
  thread_.join();
}

void ThumbnailsAhead::keep_up() {
  std::chrono::seconds rest = kBetweenLooks;
  std::unique_lock lock(mutex_);
  while (!stopping_.wait_for(lock, rest, [this] { return is_stopped_; })) {
    lock.unlock();
    try {
      rest = draw_what_is_new() ? kBetweenLooks : kBetweenTries;
    } catch (const std::exception& error) {
      spdlog::warn("event=thumbnails_not_drawn message=\"{}\"", error.what());
      rest = kBetweenTries;
    }
    lock.lock();
  }
}

bool ThumbnailsAhead::draw_what_is_new() {
  for (const VersionRecord& version : catalogue_.latest_versions()) {
    const auto seen = seen_.find(version.fabric);
    if (seen != seen_.end() && seen->second == version.number) {
      continue;
    }
    try {
      (void)swatches_.thumbnail(version);
    } catch (const core::Error& error) {
      if (may_pass(error)) {
        return false;
      }
      spdlog::info("fabric={} version={} event=no_thumbnail message=\"{}\"", version.fabric,
                   version.number, error.what());
    }
    seen_[version.fabric] = version.number;
  }
  return true;
}

}  // namespace weft::coordinator
