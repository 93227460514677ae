#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transport/checkpoint.h"
#include "transport/scene.h"

namespace weft::transport {

class EmbreeScene;

// Which directions leave the cloth from segment k's bake point without meeting another fibre
// (Khungurn et al. 2017, section 4.1), in endless cloth: resolution^2 bits of the image of the
// sphere in sphere.h, bit i % 8 of byte i / 8 for pixel i, 1 where the sky is seen. Only the
// segment's own strand is ignored; a point inside another fibre sees nothing.
// REQUIRES: resolution is a multiple of 8.
[[nodiscard]] std::vector<std::uint8_t> visibility_bits(const Scene& scene, std::uint32_t segment,
                                                        std::uint32_t resolution,
                                                        const Checkpoint& checkpoint = {});

// The same by Embree's rays, for tests and benchmarks. `embree` is of scene's tile.
[[nodiscard]] std::vector<std::uint8_t> visibility_bits(const Scene& scene,
                                                        const EmbreeScene& embree,
                                                        std::uint32_t segment,
                                                        std::uint32_t resolution);

[[nodiscard]] inline bool is_visible(std::span<const std::uint8_t> bits, std::size_t pixel) {
  return (bits[pixel / 8] >> (pixel % 8) & 1) != 0;
}

}  // namespace weft::transport
