#pragma once

#include <array>
#include <cstddef>

namespace weft::shading {

// G(mu; beta), the integral of N(t; mu, beta) cos^2 t over [-pi/2, pi/2] (Khungurn et al. 2017,
// appendix A), in double precision (absolute error below 1e-12). Even in mu, positive also at
// mu = pi/2. REQUIRES: beta > 0, |mu| <= pi/2.
[[nodiscard]] double lobe_normalisation(double mu, double beta);

// lobe_normalisation() of one width, many times over: where the Gaussian is cut off it is
// interpolated piece by piece (relative error below 1e-12).
class LobeNormalisation {
 public:
  // REQUIRES: beta > 0.
  explicit LobeNormalisation(double beta);
  [[nodiscard]] double beta() const { return beta_; }
  // REQUIRES: |mu| <= pi/2.
  [[nodiscard]] double operator()(double mu) const;

 private:
  static constexpr std::size_t kPieces = 16;
  static constexpr std::size_t kTerms = 14;

  double beta_;
  double cut_off_;  // from this |mu| on
  double piece_width_;
  std::array<std::array<double, kTerms>, kPieces> pieces_{};  // Chebyshev coefficients
};

// The factors from which the adjoint albedos follow, given theta_o: integrals over theta_i of
// M_beta(theta_i, theta_o) cos^2(theta_i), without and with the Schlick weight
// (1 - cos theta_i)^5. A_R = C_R plain + (1 - C_R) schlick; A_TT = C_TT (1 - C_R)(plain - schlick).
struct AdjointMoments {
  double plain = 0;
  double schlick = 0;
};
[[nodiscard]] AdjointMoments adjoint_moments(double theta_o, const LobeNormalisation& norm);

}  // namespace weft::shading
