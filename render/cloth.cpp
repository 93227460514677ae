#include "render/cloth.h"

#include <glm/geometric.hpp>

namespace weft::render {

glm::vec3 tangent_of(const fabric::Tile& tile, std::uint32_t k) {
  const fabric::Segment segment = tile.segment(k);
  return glm::normalize(segment.b_mm - segment.a_mm);
}

}  // namespace weft::render
