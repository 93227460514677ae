#include "render/gpu/capsule_voxels.h"

#include <string>

#include "core/error.h"

namespace weft::render::gpu {
namespace {

constexpr std::size_t kMostCapsules = std::size_t{1} << 25;

}  // namespace

std::vector<TileCapsule> capsules_in_tile(const fabric::Tile& tile, double margin_mm) {
  std::vector<TileCapsule> capsules;
  const glm::dvec2 size(tile.size_mm);
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::dvec3 half = 0.5 * (glm::dvec3(s.b_mm) - glm::dvec3(s.a_mm));
    const glm::dvec3 middle(tile.wrapped_midpoint(k));
    const auto radius = static_cast<double>(s.radius_mm);
    const glm::dvec2 reach = glm::dvec2(glm::abs(half)) + radius + margin_mm;
    // Copies moved by these many tiles reach into 0 ... size.
    const glm::ivec2 first(glm::ceil((-glm::dvec2(middle) - reach) / size));
    const glm::ivec2 last(glm::floor((size - glm::dvec2(middle) + reach) / size));
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        const glm::dvec3 centre = middle + glm::dvec3(glm::dvec2(x, y) * size, 0);
        capsules.push_back({centre - half, centre + half, radius, k});
      }
    }
    if (capsules.size() > kMostCapsules) {
      throw core::Error(core::Code::kResourceExhausted,
                        "the tile is too small for its fibres: more than " +
                            std::to_string(kMostCapsules) +
                            " copies of their segments reach into it; use shorter segments or "
                            "more repeats");
    }
  }
  return capsules;
}

}  // namespace weft::render::gpu
