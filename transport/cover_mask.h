#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace weft::transport {

inline constexpr std::uint32_t kMaxMaskResolution = 1024;

// A rectangle of the image of the sphere (sphere.h): rows first_row ... last_row, columns
// first_column ... last_column, which may begin up to a turn below 0 or end up to a turn beyond the
// last one. Empty where last < first.
struct ImageRegion {
  std::int32_t first_row = 0;
  std::int32_t last_row = -1;
  std::int32_t first_column = 0;
  std::int32_t last_column = -1;
};

// Bits first ... last of one word, clipped to it.
[[nodiscard]] inline std::uint64_t ones(std::int32_t first, std::int32_t last) {
  first = std::max(first, 0);
  last = std::min(last, 63);
  return first > last ? 0 : ~std::uint64_t{0} >> (63 - (last - first)) << first;
}

// Which pixels of the image are covered, and fast answers to "is there still anything to see?".
// Kept by columns, because the regions asked about hold few of them.
class CoverMask {
 public:
  // REQUIRES: resolution is a multiple of 8, at most kMaxMaskResolution.
  explicit CoverMask(std::uint32_t resolution)
      : resolution_(static_cast<std::int32_t>(resolution)),
        words_((resolution + 63) / 64),
        open_(words_ * resolution) {
    for (std::size_t w = 0; w < words_; ++w) {
      std::fill_n(open_.begin() + static_cast<std::ptrdiff_t>(w * resolution), resolution,
                  ones(0, resolution_ - 1 - 64 * static_cast<std::int32_t>(w)));
    }
  }

  [[nodiscard]] std::size_t words() const { return words_; }

  // Those of rows 64 word ... 64 word + 63 that are not covered in a column: bit i for row
  // 64 word + i.
  [[nodiscard]] std::uint64_t open_rows(std::size_t word, std::size_t column) const {
    return open_[word * static_cast<std::size_t>(resolution_) + column];
  }

  // Those of a word's rows that belong to the region.
  [[nodiscard]] static std::uint64_t rows_of(const ImageRegion& region, std::size_t word) {
    const std::int32_t above = 64 * static_cast<std::int32_t>(word);
    return ones(region.first_row - above, region.last_row - above);
  }

  // Whether the region has an uncovered pixel.
  [[nodiscard]] bool is_open(const ImageRegion& region) const {
    for (std::size_t w = 0; w < words_; ++w) {
      const std::uint64_t rows = rows_of(region, w);
      if (rows != 0 && (rows & rows_open_somewhere(region, w)) != 0) {
        return true;
      }
    }
    return false;
  }

  // Covers pixels of a column: bit i for row 64 word + i.
  void cover(std::size_t word, std::size_t column, std::uint64_t pixels) {
    open_[word * static_cast<std::size_t>(resolution_) + column] &= ~pixels;
  }

  void cover_all() { std::fill(open_.begin(), open_.end(), 0); }

 private:
  [[nodiscard]] std::uint64_t rows_open_somewhere(const ImageRegion& region,
                                                  std::size_t word) const {
    const std::uint64_t* open = &open_[word * static_cast<std::size_t>(resolution_)];
    const std::int32_t first = region.first_column;
    const std::int32_t last = region.last_column;
    std::uint64_t any = 0;
    for (std::int32_t c = std::max(first, 0); c <= std::min(last, resolution_ - 1); ++c) {
      any |= open[c];
    }
    for (std::int32_t c = first; c <= std::min(last, -1); ++c) {
      any |= open[c + resolution_];
    }
    for (std::int32_t c = std::max(first, resolution_); c <= last; ++c) {
      any |= open[c - resolution_];
    }
    return any;
  }

  std::int32_t resolution_;
  std::size_t words_;
  std::vector<std::uint64_t> open_;  // [words of rows, columns]
};

}  // namespace weft::transport
