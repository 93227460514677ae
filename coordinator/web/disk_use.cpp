#include "coordinator/web/disk_use.h"

#include <exception>

#include <spdlog/spdlog.h>

namespace weft::coordinator {

namespace {

constexpr double kGoodForSeconds = 300;

struct Ending {};

}  // namespace

DiskUse::~DiskUse() {
  is_ending_ = true;
  if (thread_.joinable()) {
    thread_.join();
  }
}

std::optional<DiskUse::Bytes> DiskUse::latest() {
  const std::lock_guard lock(mutex_);
  const bool is_old = !since_count_ || since_count_->seconds() > kGoodForSeconds;
  if (is_old && !is_counting_) {
    if (thread_.joinable()) {
      thread_.join();  // it is over: it said so
    }
    is_counting_ = true;
    thread_ = std::thread([this] { count(); });
  }
  return bytes_;
}

void DiskUse::count() {
  Bytes bytes;
  std::optional<Bytes> counted;
  const auto add_to = [this](std::uint64_t& sum) {
    return [this, &sum](const storage::BlobStore::Entry& entry) {
      if (is_ending_) {
        throw Ending();
      }
      sum += entry.size_bytes;
    };
  };
  try {
    scheduler_.blobs().visit(add_to(bytes.results));
    scheduler_.catalogue().pieces().visit(add_to(bytes.pieces));
    scheduler_.blobs().visit_trash(add_to(bytes.trash));
    scheduler_.catalogue().pieces().visit_trash(add_to(bytes.trash));
    counted = bytes;
  } catch (const Ending&) {
    spdlog::debug("event=disk_use_not_counted");
  } catch (const std::exception& error) {
    spdlog::warn("event=disk_use_not_counted message=\"{}\"", error.what());
  }
  const std::lock_guard lock(mutex_);
  bytes_ = counted ? counted : bytes_;
  since_count_.emplace();
  is_counting_ = false;
}

}  // namespace weft::coordinator
