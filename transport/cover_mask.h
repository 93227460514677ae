#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <immintrin.h>

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
    const std::int32_t first = region.first_column;
    const std::int32_t last = region.last_column;
    const std::int32_t n = resolution_;
    for (std::size_t w = 0; w < words_; ++w) {
      const std::uint64_t rows = rows_of(region, w);
      if (rows == 0) {
        continue;
      }
      const std::uint64_t* open = &open_[w * static_cast<std::size_t>(n)];
      if (is_open_between(open, std::max(first, 0), std::min(last, n - 1), rows) ||
          (first < 0 && is_open_between(open, first + n, std::min(last + n, n - 1), rows)) ||
          (last >= n && is_open_between(open, std::max(first - n, 0), last - n, rows))) {
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
  // Whether one of the rows is open in one of columns first ... last.
  [[nodiscard]] static bool is_open_between(const std::uint64_t* open, std::int32_t first,
                                            std::int32_t last, std::uint64_t rows) {
    __m256i any = _mm256_setzero_si256();
    std::int32_t c = first;
    for (; c + 3 <= last; c += 4) {
      any = _mm256_or_si256(any, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(open + c)));
    }
    if (c <= last) {
      const __m256i beyond = _mm256_set1_epi64x(last - c + 1);
      const __m256i wanted = _mm256_cmpgt_epi64(beyond, _mm256_setr_epi64x(0, 1, 2, 3));
      any = _mm256_or_si256(
          any, _mm256_maskload_epi64(reinterpret_cast<const long long*>(open + c), wanted));
    }
    return _mm256_testz_si256(any, _mm256_set1_epi64x(static_cast<long long>(rows))) == 0;
  }

  std::int32_t resolution_;
  std::size_t words_;
  std::vector<std::uint64_t> open_;  // [words of rows, columns]
};

}  // namespace weft::transport
