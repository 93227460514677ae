#pragma once

#include <glm/vec3.hpp>

namespace weft::shading {

// Parameters of the two-lobe BCSDF (Khungurn et al. 2015): linear RGB and radians.
struct FibreMaterial {
  glm::vec3 c_r{0, 0, 0};   // reflection at normal incidence, [0, 1]
  glm::vec3 c_tt{0, 0, 0};  // transmission colour, [0, 1]
  float beta_r = 0.1f;      // longitudinal width of reflection
  float beta_tt = 0.1f;     // longitudinal width of transmission
  float gamma_tt = 0.4f;    // azimuthal width of transmission

  bool operator==(const FibreMaterial&) const = default;
};

}  // namespace weft::shading
