#pragma once

#include <span>

#include <glm/vec3.hpp>

namespace weft::render {

// Cloth seen from theta (radians from straight above), under a white sky.
struct SkyAlbedo {
  double theta = 0;
  glm::dvec3 albedo{0, 0, 0};
};

struct Sheen {
  glm::dvec3 colour{0, 0, 0};  // each in [0, 1]
  double roughness = 0.5;
};

// Albedo of the sheen lobe of KHR_materials_sheen of colour 1: the integral of D V cos(theta_l)
// over the upper hemisphere, with alpha = roughness^2,
//   D = (2 + 1 / alpha) sin(theta_h)^(1 / alpha) / (2 pi)         (Estevez and Kulla 2017)
//   V = 1 / (4 (N.L + N.V - N.L N.V)).
[[nodiscard]] double sheen_albedo(double cos_theta, double roughness);

// The sheen that brings a surface of the albedo seen from straight above (seen[0], theta = 0) next,
// by least squares, to what is seen from elsewhere. By the extension's layering, with m the largest
// channel of the colour c, A(theta) = c E(theta) + A(0) (1 - m E(theta)): linear in c - A(0) m. No
// colour when the cloth does not get brighter aslant. REQUIRES: at least two, the first from above.
[[nodiscard]] Sheen fit_sheen(std::span<const SkyAlbedo> seen);

}  // namespace weft::render
