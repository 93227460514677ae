#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "shading/fibre_bcsdf.h"

namespace weft::render {

// What dual scattering (Zinke, Yuksel, Weber and Keyser 2008) needs of one material. Angles are
// longitudes in radians about the fibre, directions point away from it; `straight` is the azimuth
// by which the eye is off the light's own way on, phi_o - phi_d - pi, in [-pi, pi].
//
// Their averages over fibres that are turned anyhow about their axes (eqs. 4, 6 and 11 there) are
// closed for S = S_R + S_TT: S_R goes in every azimuth alike, S_TT within half a circle about
// straight on with probability p = 1 - E|v| / pi, v being its azimuthal spread. As S is normalised
// by the power that goes out, the averages are of power:
//   a_f = F / 2 + p (1 - F) C_TT,   a_b = F / 2 + (1 - p)(1 - F) C_TT,
// and beta_f^2, beta_b^2 are the variances of these mixtures, one for all colours. There is no
// shift (alpha = 0). All density factors are 1, as in Khungurn et al. 2017.
class DualFibre {
 public:
  // REQUIRES: a BCSDF with a material, not the furnace's.
  explicit DualFibre(const shading::FibreBcsdf& bcsdf);

  struct Averages {
    glm::vec3 forward{0, 0, 0};   // a_f, in [0, 1]
    glm::vec3 backward{0, 0, 0};  // a_b
    float forward_variance = 0;   // beta_f^2
    float backward_variance = 0;  // beta_b^2
  };
  [[nodiscard]] Averages averages(float theta) const;

  // Light of unit irradiance that has been spread by the fibres in its way to the variance
  // `variance` > 0 in longitude and evenly over half a circle (eq. 7), scattered once: the integral
  // of Psi^G S cos(theta_i) / T_f. Their g / cos(theta_d) is written N cos(theta_d) / G(theta_d;
  // sigma), which is the same for narrow lobes, keeps the power for wide ones and stays finite; the
  // integral over theta_i is taken by 12 nodes and not by freezing what varies slowly.
  [[nodiscard]] glm::vec3 scattered(float theta_d, float theta_o, float straight,
                                    float variance) const;

  // Light that goes on into the cloth behind and comes back after one or three backward
  // scatterings: f_back cos(theta_d) with f_back = A_b g / (pi cos^2 theta) in the backward half
  // circle (eqs. 12 to 18), A_b = a_b a_f^2 / (1 - a_f^2) + a_b^3 a_f^2 / (1 - a_f^2)^3, where
  // g / cos^2 theta is written N / G as above. In print f_back is twice that, which sends back
  // twice the power of A_b; path tracing is on the side of the power in most fabrics
  // (docs/accuracy.md). `variance` is 0 for light that came directly; otherwise that of
  // scattered(), and the backward half circles are averaged over its azimuths.
  [[nodiscard]] glm::vec3 returned(float theta_d, float theta_o, float straight,
                                   float variance) const;

  // A_b, the share of light that comes back from the fibres behind.
  [[nodiscard]] static glm::vec3 backward_attenuation(const Averages& averages);

 private:
  [[nodiscard]] float transmitted_azimuth(float straight) const;

  shading::FibreBcsdf bcsdf_;
  float forward_share_ = 0.5f;      // p
  std::vector<float> transmitted_;  // N_TT averaged over half a circle, by |straight|
};

}  // namespace weft::render
