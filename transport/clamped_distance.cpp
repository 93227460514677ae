#include "transport/clamped_distance.h"

#include <algorithm>

#include "transport/pca.h"

namespace weft::transport {

ClampedDistances::ClampedDistances(std::uint32_t resolution)
    : resolution_(resolution), transform_(resolution, kDistanceClamp + pixel_bias(resolution)) {}

void ClampedDistances::measure(std::span<const std::uint8_t> bits,
                               std::span<float> distances) const {
  transform_.measure(bits, distances);
  correct_pixel_bias(distances, resolution_);
  for (float& d : distances) {
    d = std::clamp(d, -kDistanceClamp, kDistanceClamp);
  }
}

}  // namespace weft::transport
