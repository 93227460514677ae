#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace weft::render {

// Fibres as the anisotropic GGX lobe of a surface.

// Mean of the squared sine of GGX normals of width alpha, as seen from straight above (each normal
// weighed by its cosine): with a = alpha^2, a / (1 - a)^2 (a - 1 - ln a); 1/2 for alpha = 1.
// (GGX: Walter et al. 2007, equation 33; the integral over sin^2 is elementary.)
[[nodiscard]] double ggx_squared_sine(double alpha);

// The width whose normals have the variance `variance` along one axis of the plane: where
// ggx_squared_sine(alpha) / 2 is that, at most 1. Widths below 0.01 are not told apart.
[[nodiscard]] double ggx_width(double variance);

struct SurfaceLobe {
  float roughness = 1;   // square root of the width along the fibres
  float anisotropy = 0;  // strength: the width across them is mix(roughness^2, 1, strength^2)
  // Unit. An axis has no sign: the angle from x is from -45 to 135 degrees, so that threads along x
  // and y, as most are, all have the same one.
  glm::vec2 across{1, 0};
};

// The lobe of normals whose covariance in the plane of the cloth is (xx, xy, yy).
[[nodiscard]] SurfaceLobe surface_lobe(double xx, double xy, double yy);

}  // namespace weft::render
