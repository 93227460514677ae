#pragma once

#include <cstdint>

#include "fabric/yarn_curve.h"

namespace weft::fabric {

// Yarns may overlap at most by this share of the thinner one's radius.
inline constexpr double kOverlapTolerance = 0.02;

struct RelaxReport {
  std::uint32_t iterations = 0;
  double overlap_share = 0;  // deepest overlap left, in radii of the thinner yarn
};

// Tightens the yarns of one repeat and pushes them apart until none overlaps another by more than
// kOverlapTolerance. Every iteration straightens the yarns a little (tension and bending, fading to
// a small rest), then moves every node by the mean correction of its contacts: the two yarns give
// way in inverse proportion to their section's area. Yarns of a weave are pressed flat on the way,
// down to their flattening, an unpressed side bulging as far as it keeps the area. Curves
// of role kCurve come with a shape of their own: they are only pushed apart, stay circular, and are
// left alone when they are within the tolerance. The result depends on the layout alone. Returns
// what is left; it is the caller who refuses.
RelaxReport relax(YarnLayout& layout);

// The deepest overlap of any two yarns, in radii of the thinner one; 0 when none touch.
[[nodiscard]] double deepest_overlap(const YarnLayout& layout);

}  // namespace weft::fabric
