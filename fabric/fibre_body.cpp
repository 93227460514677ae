#include "fabric/fibre_body.h"

#include "fabric/fibres.h"

namespace weft::fabric {

FibreBody::FibreBody(const Tile& tile) : size_mm(tile.size_mm) {
  for (std::uint32_t s = 0; s < tile.strands.size(); ++s) {
    const Strand& strand = tile.strands[s];
    const bool periodic = strand.period_x != 0 || strand.period_y != 0;
    const auto first = static_cast<std::uint32_t>(nodes_mm.size());
    const std::uint32_t count = strand.point_count - (periodic ? 1 : 0);
    strand_periods.emplace_back(strand.period_x, strand.period_y);
    first_nodes.push_back(first);
    for (std::uint32_t p = 0; p < count; ++p) {
      nodes_mm.emplace_back(tile.points_mm[strand.first_point + p]);
    }
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      const bool closes = p + 1 == count;
      Piece piece{first + p, closes ? first : first + p + 1, s,
                  static_cast<double>(strand.radius_mm), glm::dvec3(0)};
      if (closes) {
        piece.shift_mm = {strand.period_x * size_mm.x, strand.period_y * size_mm.y, 0};
      }
      pieces.push_back(piece);
    }
  }
  first_nodes.push_back(static_cast<std::uint32_t>(nodes_mm.size()));
}

void FibreBody::write_to(Tile& tile) const {
  for (std::size_t s = 0; s < tile.strands.size(); ++s) {
    const Strand& strand = tile.strands[s];
    const std::uint32_t count = first_nodes[s + 1] - first_nodes[s];
    for (std::uint32_t p = 0; p < count; ++p) {
      tile.points_mm[strand.first_point + p] = glm::vec3(nodes_mm[first_nodes[s] + p]);
    }
    if (count < strand.point_count) {
      tile.points_mm[strand.first_point + count] =
          period_end(tile.points_mm[strand.first_point], strand_periods[s], tile.size_mm);
    }
  }
}

}  // namespace weft::fabric
