#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace weft::transport {

// Spherical signed distance of a visibility image (Khungurn et al. 2017, section 4.1): for every
// pixel the angle, in radians, to the nearest pixel centre of the opposite value, positive where
// the sky is seen. Exact. +pi or -pi everywhere when there is no opposite.
// `bits` as visibility_bits() returns them. REQUIRES: resolution is a multiple of 8, at most 1024.
[[nodiscard]] std::vector<float> signed_distance(std::span<const std::uint8_t> bits,
                                                 std::uint32_t resolution);

// The nearest opposite pixel centre lies about 0.6 pixels beyond the edge: moves every distance
// towards zero by min(0.6 pi / resolution, |d| / 2), never across it (near the poles pixels are
// much closer than that). Distances of pi, which see no edge, stay.
void correct_pixel_bias(std::span<float> distances, std::uint32_t resolution);

}  // namespace weft::transport
