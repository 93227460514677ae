#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace weft::transport {

inline constexpr std::uint32_t kMaxMaskResolution = 1024;

// A rectangle of the image of the sphere (sphere.h): rows first_row ... last_row, and in each word
// of 64 columns that the resolution has a mask of those that belong to it.
struct ImageRegion {
  std::int32_t first_row = 0;
  std::int32_t last_row = -1;
  std::array<std::uint64_t, kMaxMaskResolution / 64> columns{};
};

// Which pixels of the image are covered, and fast answers to "is there still anything to see?".
class CoverMask {
 public:
  // REQUIRES: resolution is a multiple of 8, at most kMaxMaskResolution.
  explicit CoverMask(std::uint32_t resolution)
      : resolution_(resolution),
        words_((resolution + 63) / 64),
        covered_(std::size_t{resolution} * words_),
        open_rows_(words_) {
    for (std::uint32_t r = 0; r < resolution; ++r) {
      open_rows_[r / 64] |= std::uint64_t{1} << (r % 64);
      if (resolution % 64 != 0) {
        covered_[std::size_t{r} * words_ + words_ - 1] = ~std::uint64_t{0} << (resolution % 64);
      }
    }
  }

  [[nodiscard]] std::uint32_t resolution() const { return resolution_; }
  [[nodiscard]] std::size_t words() const { return words_; }
  [[nodiscard]] std::uint64_t* row(std::uint32_t r) { return &covered_[r * words_]; }
  [[nodiscard]] const std::uint64_t* row(std::uint32_t r) const { return &covered_[r * words_]; }

  // The first row from `from` to `to` that is not wholly covered, or a negative number.
  [[nodiscard]] std::int32_t next_open_row(std::int32_t from, std::int32_t to) const {
    for (std::int32_t r = from; r <= to; r = (r / 64 + 1) * 64) {
      const std::uint64_t rest =
          open_rows_[static_cast<std::size_t>(r) / 64] >> (static_cast<std::uint32_t>(r) % 64);
      if (rest != 0) {
        const std::int32_t found = r + std::countr_zero(rest);
        return found <= to ? found : -1;
      }
    }
    return -1;
  }

  [[nodiscard]] bool is_covered(const ImageRegion& region) const {
    for (std::int32_t r = next_open_row(region.first_row, region.last_row); r >= 0;
         r = next_open_row(r + 1, region.last_row)) {
      const std::uint64_t* bits = row(static_cast<std::uint32_t>(r));
      for (std::size_t w = 0; w < words_; ++w) {
        if ((~bits[w] & region.columns[w]) != 0) {
          return false;
        }
      }
    }
    return true;
  }

  [[nodiscard]] bool is_all_covered() const {
    return next_open_row(0, static_cast<std::int32_t>(resolution_) - 1) < 0;
  }

  // Call when bits of a row were set.
  void close_if_full(std::uint32_t r) {
    for (std::size_t w = 0; w < words_; ++w) {
      if (~row(r)[w] != 0) {
        return;
      }
    }
    open_rows_[r / 64] &= ~(std::uint64_t{1} << (r % 64));
  }

 private:
  std::uint32_t resolution_;
  std::size_t words_;
  std::vector<std::uint64_t> covered_;    // [rows, words]
  std::vector<std::uint64_t> open_rows_;  // bit r: row r has an uncovered pixel
};

}  // namespace weft::transport
