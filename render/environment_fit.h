#pragma once

#include <cstdint>
#include <vector>

#include "render/light.h"

namespace weft::render {

inline constexpr std::uint32_t kMostFittedLights = 128;

struct EnvironmentFitSettings {
  std::uint32_t most_lights = 32;  // from 1 to kMostFittedLights
  // Only what comes from above the horizon is fitted, and the lights are cut there: so many lights
  // say more about it. Implied by a light that is cut.
  bool upper_half = false;
};

// An environment as spherical Gaussian lights, none of whose amplitudes is negative.
struct EnvironmentFit {
  std::vector<SgLight> lights;
  // Root mean square over the directions fitted and the channels of what the lights get wrong, over
  // that of the map: of its radiance at 1.4 degrees, and of the irradiance on surfaces of all
  // orientations.
  double relative_error = 0;
  double irradiance_error = 0;
};

// Adds Gaussians one by one, each where it explains most of what is left, and moves and widens
// those that are there; the amplitudes, one per channel, are non-negative least squares with the
// energy of the map kept. The result depends on nothing but the arguments. REQUIRES:
// settings.most_lights is in range.
[[nodiscard]] EnvironmentFit fit_environment(const EnvironmentLight& light,
                                             const EnvironmentFitSettings& settings);

// Its two steps: the fit of the picture as it is, which is slow, and the turn of the environment
// about z (radians, counterclockwise).
[[nodiscard]] EnvironmentFit fit_unturned(const EnvironmentLight& light,
                                          const EnvironmentFitSettings& settings);
[[nodiscard]] EnvironmentFit turned(EnvironmentFit fit, double turn);

// A light from everywhere as the widest Gaussian there is; exact to 1e-4.
[[nodiscard]] SgLight gaussian_of(const UniformLight& light);

}  // namespace weft::render
