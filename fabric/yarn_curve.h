#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::fabric {

// A yarn's section at one node of its centre curve: an ellipse with half axes `half_width_mm`
// (across the yarn, in the cloth) and `half_height_mm` (out of the cloth).
struct YarnNode {
  glm::dvec3 centre_mm{0};
  double half_width_mm = 0;
  double half_height_mm = 0;
};

// One yarn's centre curve. It is periodic: the node after the last one is the first one moved by
// (period.x size.x, period.y size.y, 0). A closed ring has period (0, 0).
struct YarnCurve {
  std::uint32_t yarn = 0;  // index into the description's yarns
  double radius_mm = 0;    // of the unpressed, circular section
  double flattening = 0;   // no half axis falls below radius_mm (1 - flattening)
  Role role = Role::kCurve;
  glm::ivec2 period{0, 0};
  std::vector<YarnNode> nodes;  // at least 3
};

// All yarns of one periodic piece of cloth.
struct YarnLayout {
  glm::dvec2 size_mm{0};
  std::vector<YarnCurve> curves;
};

[[nodiscard]] glm::dvec3 period_mm(const YarnCurve& curve, glm::dvec2 size_mm);

// Length of the curve over one period, by the chords between its nodes.
[[nodiscard]] double length_mm(const YarnCurve& curve, glm::dvec2 size_mm);

// The same cloth seen as a piece of `repeats` times the size: every curve is copied, and copies
// that continue each other are joined so that their ends meet on the larger tile. Order: curve by
// curve, its copies by row, then column. REQUIRES: repeats >= 1.
[[nodiscard]] YarnLayout repeat_layout(const YarnLayout& layout, glm::uvec2 repeats);

}  // namespace weft::fabric
