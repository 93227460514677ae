#pragma once

#include <cstdint>

#include <Random123/philox.h>

namespace weft::core {

// Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): the n-th number of a stream
// depends only on (seed, stream, index, n), never on who draws it or when.
class Random {
 public:
  // `seed` is the key; `stream` (a cell, a segment, a pixel) and `index` (a sample) are the upper
  // parts of the counter. Purposes are told apart by seed: see derive_seed.
  Random(std::uint64_t seed, std::uint32_t stream, std::uint64_t index = 0)
      : key_{{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}},
        counter_{{0, stream, static_cast<std::uint32_t>(index),
                  static_cast<std::uint32_t>(index >> 32)}} {}

  [[nodiscard]] std::uint32_t bits() {
    if (used_ == 4) {
      block_ = r123::Philox4x32()(counter_, key_);
      ++counter_[0];
      used_ = 0;
    }
    return block_[used_++];
  }

  // Uniform in [0, 1), 24 bits.
  [[nodiscard]] float uniform() { return static_cast<float>(bits() >> 8) * 0x1p-24f; }

  // Uniform in [0, 1), 53 bits.
  [[nodiscard]] double uniform_double() {
    const std::uint64_t high = bits() >> 5;
    const std::uint64_t low = bits() >> 6;
    return static_cast<double>((high << 26) | low) * 0x1p-53;
  }

  // Uniform in 0 ... count - 1 (bias below 2^-32 count). REQUIRES: count > 0.
  [[nodiscard]] std::uint32_t below(std::uint32_t count) {
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>(bits()) * count) >> 32);
  }

 private:
  r123::Philox4x32::key_type key_;
  r123::Philox4x32::ctr_type counter_;
  r123::Philox4x32::ctr_type block_{};
  unsigned used_ = 4;
};

// A seed of its own for each purpose of one user-given seed.
[[nodiscard]] inline std::uint64_t derive_seed(std::uint64_t seed, std::uint32_t purpose) {
  Random random(seed, purpose, ~std::uint64_t{0});
  const std::uint64_t high = random.bits();
  return (high << 32) | random.bits();
}

}  // namespace weft::core
