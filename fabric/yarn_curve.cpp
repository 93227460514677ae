#include "fabric/yarn_curve.h"

#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::fabric {

namespace {

int wrap(int value, int modulus) { return ((value % modulus) + modulus) % modulus; }

void append_copy(const YarnCurve& from, glm::dvec2 size_mm, glm::ivec2 copy, YarnCurve& to) {
  const glm::dvec3 shift{copy.x * size_mm.x, copy.y * size_mm.y, 0};
  for (YarnNode node : from.nodes) {
    node.centre_mm += shift;
    to.nodes.push_back(node);
  }
}

}  // namespace

glm::dvec3 period_mm(const YarnCurve& curve, glm::dvec2 size_mm) {
  return {curve.period.x * size_mm.x, curve.period.y * size_mm.y, 0};
}

double length_mm(const YarnCurve& curve, glm::dvec2 size_mm) {
  double length = 0;
  for (std::size_t n = 0; n + 1 < curve.nodes.size(); ++n) {
    length += glm::distance(curve.nodes[n].centre_mm, curve.nodes[n + 1].centre_mm);
  }
  return length + glm::distance(curve.nodes.back().centre_mm,
                                curve.nodes.front().centre_mm + period_mm(curve, size_mm));
}

YarnLayout repeat_layout(const YarnLayout& layout, glm::uvec2 repeats) {
  CHECK_GE(repeats.x, 1U);
  CHECK_GE(repeats.y, 1U);
  const glm::ivec2 count{repeats};
  YarnLayout larger;
  larger.size_mm = layout.size_mm * glm::dvec2(repeats);
  for (const YarnCurve& curve : layout.curves) {
    std::vector<bool> taken(static_cast<std::size_t>(repeats.x) * repeats.y, false);
    for (int y = 0; y < count.y; ++y) {
      for (int x = 0; x < count.x; ++x) {
        glm::ivec2 at{x, y};
        const auto slot = [&] {
          return static_cast<std::size_t>(wrap(at.y, count.y) * count.x + wrap(at.x, count.x));
        };
        if (taken[slot()]) {
          continue;
        }
        YarnCurve joined = curve;
        joined.nodes.clear();
        // Follow the curve from copy to copy until it is back where it began, modulo the tile.
        while (!taken[slot()]) {
          taken[slot()] = true;
          append_copy(curve, layout.size_mm, at, joined);
          at += curve.period;
        }
        joined.period = {(at.x - x) / count.x, (at.y - y) / count.y};
        larger.curves.push_back(std::move(joined));
      }
    }
  }
  return larger;
}

}  // namespace weft::fabric
