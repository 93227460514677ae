#include "render/node/outbox.h"

#include <algorithm>

namespace weft::render {
namespace {

constexpr std::ptrdiff_t kFinishedLimit = 2;

}  // namespace

void Outbox::put(v1::RenderResponse event) {
  const std::lock_guard lock(mutex_);
  const bool replaces =
      event.has_progress() && !items_.empty() && items_.back().event.has_progress();
  if (replaces) {
    items_.back().event = std::move(event);
  } else {
    items_.push_back({std::move(event), nullptr, false});
  }
  changed_.notify_all();
}

void Outbox::put_pass(const Picture& picture) {
  auto copy = std::make_shared<const Picture>(picture);
  const std::lock_guard lock(mutex_);
  items_.erase(std::remove_if(items_.begin(), items_.end(),
                              [](const Item& item) { return item.picture && !item.finished; }),
               items_.end());
  items_.push_back({{}, std::move(copy), false});
  changed_.notify_all();
}

bool Outbox::put_finished(const Picture& picture) {
  auto copy = std::make_shared<const Picture>(picture);
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return abandoned_ || std::count_if(items_.begin(), items_.end(), [](const Item& item) {
                           return item.finished;
                         }) < kFinishedLimit;
  });
  items_.push_back({{}, std::move(copy), true});
  changed_.notify_all();
  return !abandoned_;
}

void Outbox::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

std::optional<Outbox::Item> Outbox::take() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return closed_ || abandoned_ || !items_.empty(); });
  if (items_.empty() || abandoned_) {
    return std::nullopt;
  }
  Item item = std::move(items_.front());
  items_.pop_front();
  changed_.notify_all();
  return item;
}

void Outbox::abandon() {
  const std::lock_guard lock(mutex_);
  abandoned_ = true;
  items_.clear();
  changed_.notify_all();
}

}  // namespace weft::render
