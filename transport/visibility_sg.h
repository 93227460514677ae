#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace weft::transport {

// Turn of a segment's axes about z, in units of 2 pi / 65536, the nearest to a whole number of the
// image's columns: hides the pattern that the same axes everywhere would leave (Khungurn et al.
// 2017, section 4.1). Depends on (seed, segment, resolution) only. REQUIRES: resolution <= 65536.
[[nodiscard]] std::uint16_t sg_rotation(std::uint64_t seed, std::uint32_t segment,
                                        std::uint32_t resolution);

// Axes of the sum of spherical Gaussians: spherical Fibonacci points of the upper hemisphere, q = 1
// ... count, phi = 4 pi q / (1 + sqrt 5) + rotation, z = 1 - (q - 1/2) / count. The paper prints z
// = 1 - (q - 1) / count, which is off by half a cell.
[[nodiscard]] std::vector<glm::vec3> sg_axes(std::uint32_t count, std::uint16_t rotation);

// Weights of the axes of sg_axes(): the solid angle of the visible pixels that lie nearest to each.
// Pixels below the horizon count as not visible, else all light from below would enter through the
// lowest axes. Immutable: any thread may call.
class SgRegions {
 public:
  // REQUIRES: count > 0, resolution a positive multiple of 8.
  SgRegions(std::uint32_t count, std::uint32_t resolution);

  // In steradian. REQUIRES: `rotation` is sg_rotation() at this resolution for some segment.
  [[nodiscard]] std::vector<float> weights(std::span<const std::uint8_t> bits,
                                           std::uint16_t rotation) const;

 private:
  struct Region {  // the pixels of one row that are nearest to one axis, unrotated
    std::uint32_t axis;
    std::size_t first_word;  // of its bits
  };

  std::uint32_t count_;
  std::uint32_t resolution_;
  std::size_t row_words_;
  std::vector<double> solid_angles_;       // [row] of a pixel
  std::vector<Region> regions_;            // by row
  std::vector<std::size_t> first_region_;  // [row], and the number of regions
  std::vector<std::uint64_t> words_;
};

// Share of the whole sphere's solid angle that is visible, [0, 1].
[[nodiscard]] double open_share(std::span<const std::uint8_t> bits, std::uint32_t resolution);

}  // namespace weft::transport
