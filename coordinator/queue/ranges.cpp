#include "coordinator/queue/ranges.h"

#include <algorithm>
#include <iterator>

#include "core/check.h"

namespace weft::coordinator {

void ShardRanges::add(std::uint64_t first, std::uint64_t count) {
  if (count == 0) {
    return;
  }
  std::uint64_t end = first + count;
  auto it = ranges_.upper_bound(first);
  if (it != ranges_.begin() && std::prev(it)->second >= first) {
    --it;
  }
  while (it != ranges_.end() && it->first <= end) {
    first = std::min(first, it->first);
    end = std::max(end, it->second);
    size_ -= it->second - it->first;
    it = ranges_.erase(it);
  }
  ranges_.emplace_hint(it, first, end);
  size_ += end - first;
}

void ShardRanges::remove(std::uint64_t first, std::uint64_t count) {
  const std::uint64_t end = first + count;
  auto it = ranges_.upper_bound(first);
  if (it != ranges_.begin()) {
    --it;
  }
  while (it != ranges_.end() && it->first < end) {
    const auto [begun, ended] = *it;
    if (ended <= first) {
      ++it;
      continue;
    }
    size_ -= std::min(ended, end) - std::max(begun, first);
    it = ranges_.erase(it);
    if (begun < first) {
      ranges_.emplace(begun, first);
    }
    if (ended > end) {
      ranges_.emplace(end, ended);
    }
  }
}

void ShardRanges::clear() {
  ranges_.clear();
  size_ = 0;
}

bool ShardRanges::contains(std::uint64_t shard) const {
  const auto after = ranges_.upper_bound(shard);
  return after != ranges_.begin() && shard < std::prev(after)->second;
}

ShardRanges::Range ShardRanges::front() const {
  CHECK(!ranges_.empty());
  const auto [first, end] = *ranges_.begin();
  return {first, end - first};
}

}  // namespace weft::coordinator
