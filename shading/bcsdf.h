// Shared text (C++20 and GLSL): the two-lobe BCSDF of Khungurn et al. 2015, as in Khungurn et al.
// 2017, appendix A, whose Fresnel factor is misprinted (a minus for the plus).
#ifndef WEFT_SHADING_BCSDF_H
#define WEFT_SHADING_BCSDF_H

#include "shading/dialect.h"
#include "shading/fibre_angle.h"

SHARED_BEGIN

const int kLobeTableCells = 2048;

// What a kernel needs of one material. `table` has kLobeTableCells + 1 entries, the values of
// sqrt(2 pi) beta G(theta; beta) for R and TT, graded towards the axis: entry i belongs to
// |theta| = pi/2 (1 - (i / cells)^2).
struct FibreLobes {
  vec3 c_r;
  vec3 c_tt;
  float precision_r;   // 1 / beta_R^2
  float precision_tt;  // 1 / beta_TT^2
  float kappa_tt;      // 1 / gamma_TT^2
  float azimuth_norm;  // 1 / (2 pi I0e(kappa_tt))
  LobeTable table;
};

// F(theta) = C_R + (1 - C_R)(1 - cos theta)^5.
SHARED float schlick_weight(float cos_theta) {
  float m = max(0.0f, 1.0f - cos_theta);
  float m2 = m * m;
  return m2 * m2 * m;
}
SHARED vec3 fresnel(vec3 c_r, float cos_theta) {
  return c_r + (vec3(1.0f, 1.0f, 1.0f) - c_r) * schlick_weight(cos_theta);
}

// sqrt(2 pi) beta G(theta; beta) for R and TT; pole = pi/2 - |theta|.
SHARED vec2 lobe_norm(FibreLobes lobes, float pole) {
  float t = sqrt(clamp(pole, 0.0f, kHalfPi) * (1.0f / kHalfPi)) * float(kLobeTableCells);
  int i = min(int(t), kLobeTableCells - 1);
  float f = t - float(i);
  vec2 low = lobe_table_entry(lobes.table, i);
  vec2 high = lobe_table_entry(lobes.table, i + 1);
  return low + (high - low) * f;
}

// Both lobes at once: S_R and S_TT in 1/sr.
struct LobePair {
  vec3 r;
  vec3 tt;
};

// exp(-(theta_i + theta_o)^2 / (2 beta^2)) for R and TT.
SHARED vec2 lobe_gaussians(FibreLobes lobes, float theta_i, float theta_o) {
  float d = theta_i + theta_o;
  float half_d2 = 0.5f * d * d;
  return vec2(exp(-half_d2 * lobes.precision_r), exp(-half_d2 * lobes.precision_tt));
}

// From M_beta(theta_i, theta_o) = N(theta_o; -theta_i, beta) / G(theta_i; beta):
//   S_R  = F M_R / (2 pi)
//   S_TT = (1 - F) C_TT M_TT exp(-kappa (1 + cos phi)) / (2 pi I0e(kappa)),
// phi = phi_i - phi_o; light that goes straight on has phi = pi, both directions pointing outward.
// `gaussians` are lobe_gaussians of the two longitudes.
SHARED LobePair bcsdf_lobes(FibreLobes lobes, FibreAngle i, vec2 gaussians, float cos_phi) {
  vec2 norm = lobe_norm(lobes, i.pole);
  float m_r = gaussians.x / norm.x;
  float m_tt = gaussians.y * exp(-lobes.kappa_tt * (1.0f + cos_phi)) / norm.y;
  vec3 f = fresnel(lobes.c_r, i.cos_theta);
  LobePair s;
  s.r = f * (m_r * (1.0f / kTwoPi));
  s.tt = (vec3(1.0f, 1.0f, 1.0f) - f) * lobes.c_tt * (m_tt * lobes.azimuth_norm);
  return s;
}

// S(omega_i, omega_o) in 1/sr, without the cosine; omega_i is the light side.
SHARED vec3 bcsdf(FibreLobes lobes, vec3 omega_i, vec3 omega_o) {
  FibreAngle i = fibre_angle(omega_i);
  FibreAngle o = fibre_angle(omega_o);
  vec2 gaussians = lobe_gaussians(lobes, i.theta, o.theta);
  LobePair s = bcsdf_lobes(lobes, i, gaussians, cos_phi_between(omega_i, i, omega_o, o));
  return s.r + s.tt;
}

SHARED_END

#endif
