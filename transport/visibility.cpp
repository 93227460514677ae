#include "transport/visibility.h"

#include <cmath>
#include <limits>

#include "core/check.h"
#include "transport/bake_point.h"
#include "transport/embree_scene.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

template <class Rays>
std::vector<std::uint8_t> bits_by(const Rays& rays, const BakePoint& from, std::uint32_t resolution,
                                  const Checkpoint& checkpoint) {
  CHECK_EQ(resolution % 8, 0U);
  constexpr float kFar = std::numeric_limits<float>::infinity();
  std::vector<std::uint8_t> bits(std::size_t{resolution} * resolution / 8);
  std::size_t pixel = 0;
  for (std::uint32_t row = 0; row < resolution; ++row) {
    pass(checkpoint);
    const double theta = row_theta(row, resolution);
    for (std::uint32_t column = 0; column < resolution; ++column, ++pixel) {
      const double phi = column_phi(column, resolution);
      const glm::vec3 direction{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                std::cos(theta)};
      if (!rays.occluded(from.position_mm, direction, kFar, from.own)) {
        bits[pixel / 8] = static_cast<std::uint8_t>(bits[pixel / 8] | 1U << (pixel % 8));
      }
    }
  }
  return bits;
}

}  // namespace

std::vector<std::uint8_t> visibility_bits(const Scene& scene, std::uint32_t segment,
                                          std::uint32_t resolution, const Checkpoint& checkpoint) {
  return bits_by(scene, bake_point(scene, segment), resolution, checkpoint);
}

std::vector<std::uint8_t> visibility_bits(const Scene& scene, const EmbreeScene& embree,
                                          std::uint32_t segment, std::uint32_t resolution) {
  return bits_by(embree, bake_point(scene, segment), resolution, {});
}

}  // namespace weft::transport
