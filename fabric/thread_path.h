#pragma once

#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/yarn_curve.h"

namespace weft::fabric {

// Where a yarn is at one place of its length: lateral, normal and tangent are unit, at right
// angles, and normal x lateral = tangent. Offsets from the centre are given for the circular yarn;
// the pressed section scales them along normal and lateral.
struct YarnFrame {
  glm::dvec3 centre_mm{0};
  glm::dvec3 normal{0};   // out of the cloth as far as the tangent allows
  glm::dvec3 lateral{0};  // across the yarn
  double normal_scale = 1;
  double lateral_scale = 1;

  // The place of the circular yarn's offset (along normal, along lateral).
  [[nodiscard]] glm::dvec3 place_mm(glm::dvec2 offset_mm) const {
    return centre_mm + normal * (normal_scale * offset_mm.x) +
           lateral * (lateral_scale * offset_mm.y);
  }
};

// A yarn's smooth centre curve with its frames, by arc length. Warp and weft take their frame from
// the cloth's axes; other curves carry it without torsion, the angle left over after a period
// spread evenly along it.
class ThreadPath {
 public:
  ThreadPath(const YarnCurve& curve, glm::dvec2 size_mm);

  [[nodiscard]] double length_mm() const { return length_mm_; }
  // The frame at `share` of the period's length; any real number, the curve goes on for ever.
  [[nodiscard]] YarnFrame at(double share) const;

 private:
  std::vector<YarnFrame> frames_;  // equidistant; the last is the first, moved by the period
  glm::dvec3 period_mm_{0};
  double length_mm_ = 0;
};

}  // namespace weft::fabric
