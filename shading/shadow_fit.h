#pragma once

#include <span>

namespace weft::shading {

struct ShadowFit {
  double sigma = 0;  // in widths of a bin
  // Root mean square of what the fit gets wrong, as a share of the light, over the distances at
  // which the shadow's edge is seen: those of 4 sigma.
  double error = 0;
};

// The standard deviation sigma with which the distribution function of the normal distribution,
// Phi(d / sigma), is the shadow of multiple scattering across the edge of a half-plane at distance
// d from it (Khungurn et al. 2017, section 5.3.2), by least squares. `light` holds, for bins of
// equal width, the light that entered as far to either side of where it is seen, and then all from
// beyond the last bin. Half of what came from nearer than d came from each side: within the light
// arrives 1/2 + 1/2 F(d). REQUIRES: at least one bin, no negative light, some light in the bins.
[[nodiscard]] ShadowFit fit_shadow(std::span<const double> light);

}  // namespace weft::shading
