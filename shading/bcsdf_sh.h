#pragma once

#include <array>
#include <vector>

#include "shading/fibre_material.h"
#include "shading/spherical_harmonics.h"

namespace weft::shading {

inline constexpr int kBcsdfShAngles = 512;

// C_S(theta_o)[channel][j]: the harmonics of omega -> S(omega, omega_o) cos(theta) in omega_o-space
// (x = tangent, phi_o = 0), order 5, in double precision; Khungurn et al. 2017, section 5.3.1.
using BcsdfSh = std::array<std::array<double, kShMaxCount>, 3>;
[[nodiscard]] BcsdfSh bcsdf_sh(const FibreMaterial& material, double theta_o);

// The table of a material, [3 channels][kBcsdfShAngles][(order + 1)^2], for theta_o = -pi/2 + pi i
// / (kBcsdfShAngles - 1). REQUIRES: 0 <= order <= kShMaxOrder.
[[nodiscard]] std::vector<float> bcsdf_sh_table(const FibreMaterial& material, int order);

}  // namespace weft::shading
