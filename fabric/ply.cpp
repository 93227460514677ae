#include "fabric/ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "core/check.h"
#include "core/error.h"

namespace weft::fabric {

PlySection ply_section(std::uint32_t plies, double aspect) {
  CHECK_GE(plies, 1U);
  if (plies == 1) {
    return {0, aspect, 1};
  }
  // With tangential half axis 1: the ellipse touches the wedge line between it and its neighbour
  // where its support along the line's normal equals the centre's distance from the line.
  const double half_wedge = std::numbers::pi / plies;
  const double sine = std::sin(half_wedge);
  const double cosine = std::cos(half_wedge);
  const double support = std::sqrt(aspect * aspect * sine * sine + cosine * cosine);
  const double distance = support / sine;
  // The ellipse's farthest point from the axis: maximise (d + a c)^2 + 1 - c^2 over c = cos t.
  const double rest = 1 - aspect * aspect;
  const double c = rest > 0 ? std::min(1.0, aspect * distance / rest) : 1.0;
  const double reach = std::sqrt((distance + aspect * c) * (distance + aspect * c) + 1 - c * c);
  return {distance / reach, aspect / reach, 1 / reach};
}

YarnModel yarn_model(const v1::Yarn& yarn, double yarn_radius_mm, const v1::Exemplar& exemplar) {
  YarnModel model;
  model.plies = yarn.plies();
  const double described = yarn.fibres_per_ply();
  model.fibres_per_ply =
      static_cast<std::uint32_t>(std::max(1.0, std::nearbyint(described * exemplar.fibre_share())));
  model.share = model.fibres_per_ply / described;
  model.fibre_radius_mm =
      yarn.fibre_radius_mm() * (yarn_radius_mm / yarn.yarn_radius_mm()) / std::sqrt(model.share);
  model.yarn_radius_mm = yarn_radius_mm;
  model.section = ply_section(model.plies, yarn.ply_aspect());

  const double area =
      model.section.radial * model.section.tangential * model.yarn_radius_mm * model.yarn_radius_mm;
  const double fibre_area = model.fibre_radius_mm * model.fibre_radius_mm;
  const double packing = model.fibres_per_ply * fibre_area / area;
  const double densest = model.fibres_per_ply == 1 ? 1.0 : kDensestPacking;
  const double thinnest = std::min(model.section.radial, model.section.tangential);
  if (packing > densest * (1 + 1e-9) ||
      model.fibre_radius_mm > thinnest * model.yarn_radius_mm * (1 + 1e-9)) {
    std::array<char, 400> text{};
    std::snprintf(text.data(), text.size(),
                  "yarn '%s': %u fibres of radius %.4g mm fill %.0f %% of a ply with half axes "
                  "%.4g and %.4g mm, more than fits; use thinner or fewer fibres (radius at most "
                  "%.4g mm) or a thicker yarn",
                  yarn.name().c_str(), model.fibres_per_ply, model.fibre_radius_mm, 100 * packing,
                  model.section.radial * model.yarn_radius_mm,
                  model.section.tangential * model.yarn_radius_mm,
                  std::min(std::sqrt(densest * area / model.fibres_per_ply),
                           thinnest * model.yarn_radius_mm));
    throw core::Error(core::Code::kInvalidArgument, text.data());
  }
  return model;
}

}  // namespace weft::fabric
