#pragma once

#include <cstdint>
#include <map>

namespace weft::coordinator {

// A set of shard numbers, kept as ranges: a million in a row cost as much as one.
class ShardRanges {
 public:
  struct Range {
    std::uint64_t first = 0;
    std::uint64_t count = 0;
  };

  void add(std::uint64_t first, std::uint64_t count = 1);     // some may be in it already
  void remove(std::uint64_t first, std::uint64_t count = 1);  // some may not be in it
  void clear();

  [[nodiscard]] bool contains(std::uint64_t shard) const;
  [[nodiscard]] bool empty() const { return ranges_.empty(); }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] Range front() const;  // the lowest numbers in a row. REQUIRES: !empty()

 private:
  std::map<std::uint64_t, std::uint64_t> ranges_;  // first -> end; they do not touch each other
  std::uint64_t size_ = 0;
};

}  // namespace weft::coordinator
