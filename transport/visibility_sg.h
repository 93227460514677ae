#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::transport {

// Turn of a segment's axes about z, in units of 2 pi / 65536: hides the pattern that the same axes
// everywhere would leave (Khungurn et al. 2017, section 4.1). Depends on (seed, segment) only.
[[nodiscard]] std::uint16_t sg_rotation(std::uint64_t seed, std::uint32_t segment);

// Axes of the sum of spherical Gaussians: spherical Fibonacci points of the upper hemisphere, q = 1
// ... count, phi = 4 pi q / (1 + sqrt 5) + rotation, z = 1 - (q - 1/2) / count. The paper prints z
// = 1 - (q - 1) / count, which is off by half a cell.
[[nodiscard]] std::vector<glm::vec3> sg_axes(std::uint32_t count, std::uint16_t rotation);

// Weight of every axis, in steradian: the solid angle of the visible pixels that lie nearest to it.
// Pixels below the horizon count as not visible, else all light from below would enter through the
// lowest axes.
[[nodiscard]] std::vector<float> sg_weights(std::span<const std::uint8_t> bits,
                                            std::uint32_t resolution,
                                            std::span<const glm::vec3> axes);

// Share of the whole sphere's solid angle that is visible, [0, 1].
[[nodiscard]] double open_share(std::span<const std::uint8_t> bits, std::uint32_t resolution);

}  // namespace weft::transport
