#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/random.h"

namespace weft::core {

// The first dimensions of Sobol's sequence (direction numbers of Joe and Kuo 2008), with Owen's
// nested scrambling by the hash of Laine and Karras 2011 (as in Burley 2020). Point i depends on
// (seed, stream, i) only, and over seeds each coordinate is exactly uniform: the seed enters the
// hash by an addition alone. Any 2^k points from a multiple of 2^k on are a net.
class SobolPoints {
 public:
  static constexpr std::size_t kDimensions = 6;
  using Point = std::array<std::uint32_t, kDimensions>;  // in units of 2^-32

  // `stream` as in Random.
  SobolPoints(std::uint64_t seed, std::uint32_t stream);

  [[nodiscard]] Point point(std::uint32_t index) const;

 private:
  Point seeds_{};
};

}  // namespace weft::core
