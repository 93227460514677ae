#include "render/cloth.h"

#include <cmath>

#include <glm/geometric.hpp>

namespace weft::render {

std::optional<FlatHit> closest_in_flat(const transport::Scene& scene, const glm::dvec3& start_mm,
                                       const glm::dvec3& way_mm,
                                       const std::optional<transport::StrandCopy>& ignored) {
  const double length_mm = glm::length(way_mm);
  if (!(length_mm > 0)) {
    return std::nullopt;
  }
  // Wrapped in double before it becomes float: far from the origin nothing is lost.
  const glm::dvec2 size(scene.tile().size_mm);
  const glm::dvec2 tile = glm::floor(glm::dvec2(start_mm) / size);
  const glm::vec3 origin(glm::dvec3(glm::dvec2(start_mm) - tile * size, start_mm.z));
  const glm::ivec2 own_tile = glm::ivec2(tile) + scene.tile_of(origin);
  std::optional<transport::StrandCopy> seen;
  if (ignored) {
    seen = scene.seen_from(*ignored, own_tile);
  }
  const std::optional<transport::Hit> hit =
      scene.closest(origin, glm::vec3(way_mm / length_mm), static_cast<float>(length_mm), seen);
  if (!hit) {
    return std::nullopt;
  }
  return FlatHit{static_cast<double>(hit->t_mm) / length_mm, hit->segment,
                 scene.seen_from(hit->copy, -own_tile)};
}

glm::vec3 tangent_of(const fabric::Tile& tile, std::uint32_t k) {
  const fabric::Segment segment = tile.segment(k);
  return glm::normalize(segment.b_mm - segment.a_mm);
}

}  // namespace weft::render
