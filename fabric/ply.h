#pragma once

#include <cstdint>

#include "proto/weft/v1/fabric.pb.h"

namespace weft::fabric {

// The section of a yarn of equal elliptical plies in units of the yarn's radius: each ply's centre
// lies at `distance` from the axis; `radial` and `tangential` are its half axes along and at right
// angles to that direction. Neighbours touch, and all lie within the unit circle.
struct PlySection {
  double distance = 0;
  double radial = 1;
  double tangential = 1;
};
// REQUIRES: plies >= 1, 0 < aspect <= 1 (radial over tangential).
[[nodiscard]] PlySection ply_section(std::uint32_t plies, double aspect);

// A yarn as its fibres are laid: counts and radii after fibre_share, twists as whole turns.
struct YarnModel {
  std::uint32_t plies = 1;
  std::uint32_t fibres_per_ply = 1;
  double fibre_radius_mm = 0;
  double yarn_radius_mm = 0;
  PlySection section;
  double share = 1;  // fibres kept of those described; hairs and loops are thinned alike
};

// fibre_share keeps max(1, round(share n)) of a ply's n fibres and makes them thicker so that they
// fill the same area: the radius grows by sqrt(n / kept). (Projected cover falls by the same
// factor; growing by n / kept would keep it, but soon packs fibres denser than there is room.)
// `yarn_radius_mm` is the yarn's own or one that its curves prescribe, to which the
// fibres' radius is scaled along. Throws
// core::Error(kInvalidArgument) when the fibres would fill more than kDensestPacking of
// their ply, or one alone does not fit.
[[nodiscard]] YarnModel yarn_model(const v1::Yarn& yarn, double yarn_radius_mm,
                                   const v1::Exemplar& exemplar);

// The same at the yarn's own radius.
[[nodiscard]] inline YarnModel yarn_model(const v1::Yarn& yarn, const v1::Exemplar& exemplar) {
  return yarn_model(yarn, yarn.yarn_radius_mm(), exemplar);
}

// Circles of equal size fill at most pi / (2 sqrt(3)) of the plane.
inline constexpr double kDensestPacking = 0.9069;

}  // namespace weft::fabric
