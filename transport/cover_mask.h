#pragma once

#include <algorithm>
#include <array>
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

// Which pixels of the image are covered, and fast answers to "is there still anything to see?".
// Kept by columns, because the regions asked about hold few of them, and by bands of 128 rows.
class CoverMask {
 public:
  // REQUIRES: resolution is a multiple of 8, at most kMaxMaskResolution.
  explicit CoverMask(std::uint32_t resolution)
      : resolution_(static_cast<std::int32_t>(resolution)),
        bands_((resolution_ + kBandRows - 1) / kBandRows),
        open_(static_cast<std::size_t>(bands_) * resolution) {
    for (std::int32_t band = 0; band < bands_; ++band) {
      const auto first = static_cast<std::ptrdiff_t>(band) * resolution_;
      std::fill_n(open_.begin() + first, resolution_, above(resolution_, band));
    }
  }

  // Those of rows 64 word ... 64 word + 63 that are not covered in a column: bit i for row
  // 64 word + i.
  [[nodiscard]] std::uint64_t open_rows(std::size_t word, std::size_t column) const {
    return open_[word / 2 * static_cast<std::size_t>(resolution_) + column].words[word % 2];
  }

  // Whether the region has an uncovered pixel.
  [[nodiscard]] bool is_open(const ImageRegion& region) const {
    if (bands_ == 1 && region.first_column >= 0 && region.last_column < resolution_) {
      return is_open_between(open_.data(), region.first_column, region.last_column,
                             rows_of(region, 0));
    }
    return is_open_in_parts(region);
  }

  // Covers pixels of a column: bit i for row 64 word + i.
  void cover(std::size_t word, std::size_t column, std::uint64_t pixels) {
    open_[word / 2 * static_cast<std::size_t>(resolution_) + column].words[word % 2] &= ~pixels;
  }

  void cover_all() { std::fill(open_.begin(), open_.end(), Rows{}); }

  // The open pixels, row by row: bit i % 8 of byte i / 8 for pixel i.
  [[nodiscard]] std::vector<std::uint8_t> open_pixels() const {
    const auto n = static_cast<std::size_t>(resolution_);
    std::vector<std::uint8_t> bits(n * n / 8);
    for (std::size_t row = 0; row < n; row += 8) {
      for (std::size_t column = 0; column < n; column += 8) {
        std::uint64_t eight = 0;  // byte i for column + i
        for (std::size_t i = 0; i < 8; ++i) {
          eight |= (open_rows(row / 64, column + i) >> row % 64 & 0xffU) << 8 * i;
        }
        eight = transposed(eight);
        for (std::size_t i = 0; i < 8; ++i) {
          bits[((row + i) * n + column) / 8] = static_cast<std::uint8_t>(eight >> 8 * i);
        }
      }
    }
    return bits;
  }

 private:
  static constexpr std::int32_t kBandRows = 128;

  // Of one column and band.
  struct Rows {
    std::array<std::uint64_t, 2> words{};
  };

  [[nodiscard]] static __m128i load(const Rows& rows) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(rows.words.data()));
  }

  // The rows of a band above row `row` of the image.
  [[nodiscard]] static const Rows& above(std::int32_t row, std::int32_t band) {
    static constexpr std::array<Rows, kBandRows + 1> kAbove = [] {
      std::array<Rows, kBandRows + 1> all{};
      for (std::size_t i = 0; i < kBandRows; ++i) {
        all[i + 1] = all[i];
        all[i + 1].words[i / 64] |= std::uint64_t{1} << i % 64;
      }
      return all;
    }();
    return kAbove[static_cast<std::size_t>(std::clamp(row - band * kBandRows, 0, kBandRows))];
  }

  [[nodiscard]] static __m128i rows_of(const ImageRegion& region, std::int32_t band) {
    return _mm_andnot_si128(load(above(region.first_row, band)),
                            load(above(region.last_row + 1, band)));
  }

  [[nodiscard, gnu::noinline]] bool is_open_in_parts(const ImageRegion& region) const {
    const std::int32_t first = region.first_column;
    const std::int32_t last = region.last_column;
    const std::int32_t n = resolution_;
    for (std::int32_t band = 0; band < bands_; ++band) {
      const __m128i rows = rows_of(region, band);
      const Rows* open = open_.data() + static_cast<std::ptrdiff_t>(band) * n;
      if (is_open_between(open, std::max(first, 0), std::min(last, n - 1), rows) ||
          (first < 0 && is_open_between(open, first + n, std::min(last + n, n - 1), rows)) ||
          (last >= n && is_open_between(open, std::max(first - n, 0), last - n, rows))) {
        return true;
      }
    }
    return false;
  }

  // Whether one of the rows is open in one of columns first ... last.
  [[nodiscard]] static bool is_open_between(const Rows* open, std::int32_t first, std::int32_t last,
                                            __m128i rows) {
    __m256i any = _mm256_setzero_si256();
    std::int32_t c = first;
    for (; c < last; c += 2) {
      any = _mm256_or_si256(any, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(open + c)));
    }
    if (c == last) {
      any = _mm256_or_si256(any, _mm256_zextsi128_si256(load(open[c])));
    }
    return _mm256_testz_si256(any, _mm256_broadcastsi128_si256(rows)) == 0;
  }

  // Bit 8 i + j becomes bit 8 j + i (Warren, Hacker's Delight, section 7-3).
  [[nodiscard]] static std::uint64_t transposed(std::uint64_t x) {
    std::uint64_t t = (x ^ x >> 7) & 0x00aa00aa00aa00aa;
    x ^= t ^ t << 7;
    t = (x ^ x >> 14) & 0x0000cccc0000cccc;
    x ^= t ^ t << 14;
    t = (x ^ x >> 28) & 0x00000000f0f0f0f0;
    return x ^ t ^ t << 28;
  }

  std::int32_t resolution_;
  std::int32_t bands_;
  std::vector<Rows> open_;  // [bands, columns]
};

}  // namespace weft::transport
