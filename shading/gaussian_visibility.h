// Shared text (C++20 and GLSL): single scattering through visibility that is a sum of Gaussians.
#ifndef WEFT_SHADING_GAUSSIAN_VISIBILITY_H
#define WEFT_SHADING_GAUSSIAN_VISIBILITY_H

#include "shading/dialect.h"
#include "shading/fibre_angle.h"
#include "shading/gamma.h"
#include "shading/spherical_gaussian.h"
#ifndef WEFT_SHADING_FABRIC_TABLES
#include "shading/fabric_tables.h"
#endif

SHARED_BEGIN

// A fibre as it is seen: what the flat fabric's directions become in omega_o-space, and omega_o
// there.
struct SeenFibre {
  mat3 to_fibre;
  vec3 omega_o;
};

SHARED SeenFibre seen_fibre(vec3 tangent, vec3 omega_o) {
  SeenFibre seen;
  seen.to_fibre = fibre_frame(tangent, omega_o);
  seen.omega_o = seen.to_fibre * omega_o;
  return seen;
}

// Gamma of a Gaussian whose axis is given in the flat fabric.
SHARED vec3 gamma_of_seen(SeenFibre seen, FibreLobes lobes, SphericalGaussian flat_sg, int method) {
  SphericalGaussian local;
  local.axis = seen.to_fibre * flat_sg.axis;
  local.sharpness = flat_sg.sharpness;
  return gamma_integral(lobes, local, seen.omega_o, method);
}

// Axis q of a segment: that of rotation 0, turned about z. `turn`: cosine and sine.
SHARED vec3 turned_about_z(vec3 axis, vec2 turn) {
  return vec3(turn.x * axis.x - turn.y * axis.y, turn.y * axis.x + turn.x * axis.y, axis.z);
}

// Cosine and sine of `rotation` 65,536ths of a turn.
SHARED vec2 cos_sin_of_rotation(int rotation) {
  int half_turn = rotation >= 32768 ? rotation - 65536 : rotation;
  return cos_sin_half(float(half_turn) * (kTwoPi / 65536.0f));
}

// Terms of the sum below this share of the largest possible one are left out (a logarithm).
const float kNegligibleLogScale = -20.0f;

// L = 1 / M(lambda) sum_q w_q / M(lambda_v) e^-x_q Gamma(s_q / |s_q|, |s_q|, omega_o), where q's
// Gaussian times the light is e^-x_q times the Gaussian of s_q (Khungurn et al. 2017, section
// 5.2.2, with the light's 1 / M(lambda), which is missing in print). `light` in the flat fabric.
SHARED vec3 single_by_gaussians(FabricTables tables, int segment, SeenFibre seen, FibreLobes lobes,
                                SphericalGaussian light, int method) {
  FabricSizes sizes = fabric_sizes(tables);
  vec2 turn = cos_sin_of_rotation(gaussian_rotation(tables, segment));
  vec3 sum = vec3(0.0f, 0.0f, 0.0f);
  for (int q = 0; q < sizes.gaussians; ++q) {
    float weight = gaussian_weight(tables, segment, q);
    if (!(weight > 0.0f)) {
      continue;
    }
    SphericalGaussian open;
    open.axis = turned_about_z(gaussian_axis(tables, q), turn);
    open.sharpness = sizes.sharpness;
    SgProduct product = sg_product(open, light);
    if (product.log_scale < kNegligibleLogScale) {
      continue;
    }
    sum += gamma_of_seen(seen, lobes, product.sg, method) * (weight * exp(product.log_scale));
  }
  return sum / (sg_mass(sizes.sharpness) * sg_mass(light.sharpness));
}

SHARED_END

#endif
