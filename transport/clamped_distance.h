#pragma once

#include <cstdint>
#include <span>

#include "transport/signed_distance.h"

namespace weft::transport {

// What principal components are made of: signed distances of visibility images, with the bias of
// their pixels taken off, clamped to kDistanceClamp. Any thread.
class ClampedDistances {
 public:
  explicit ClampedDistances(std::uint32_t resolution);

  // Of an image of resolution^2 bits, in radians. REQUIRES: resolution^2 distances.
  void measure(std::span<const std::uint8_t> bits, std::span<float> distances) const;

 private:
  std::uint32_t resolution_;
  DistanceTransform transform_;
};

}  // namespace weft::transport
