#include "render/environment_fit.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "render/sky_fitter.h"
#include "render/sphere_sampling.h"
#include "shading/visibility.h"

namespace weft::render {
namespace {

// Irradiance on surfaces of all orientations: what is missing, over what there is.
double irradiance_error(const SkyGrid& grid, const std::vector<glm::vec3>& residual) {
  constexpr int kOrientations = 256;
  double missing = 0;
  double whole = 0;
  for (int q = 0; q < kOrientations; ++q) {
    const glm::vec3 normal = shading::fibonacci_axis_sphere(q, kOrientations, 0);
    glm::dvec3 lost(0);
    glm::dvec3 all(0);
    for (std::size_t i = 0; i < residual.size(); ++i) {
      const float part =
          std::max(0.0f, glm::dot(normal, grid.directions[i])) * grid.solid_angles[i];
      lost += glm::dvec3(part * residual[i]);
      all += glm::dvec3(part * grid.radiance[i]);
    }
    missing += glm::dot(lost, lost);
    whole += glm::dot(all, all);
  }
  return std::sqrt(missing / whole);
}

}  // namespace

EnvironmentFit fit_environment(const EnvironmentLight& light,
                               const EnvironmentFitSettings& settings) {
  return turned(fit_unturned(light, settings), light.environment->turn());
}

EnvironmentFit fit_unturned(const EnvironmentLight& light, const EnvironmentFitSettings& settings) {
  CHECK(light.environment != nullptr);
  CHECK(settings.most_lights >= 1 && settings.most_lights <= kMostFittedLights);
  const bool upper_half = settings.upper_half || light.cut_at_horizon;
  const SkyGrid grid = make_sky_grid(light.environment->picture(), upper_half);
  EnvironmentFit fit;
  if (std::all_of(grid.radiance.begin(), grid.radiance.end(),
                  [](const glm::vec3& radiance) { return radiance == glm::vec3(0); })) {
    return fit;  // nothing comes from above
  }
  SkyFitter fitter(grid);
  fitter.run(settings.most_lights);
  for (const SkyGaussian& g : fitter.gaussians()) {
    fit.lights.push_back({glm::normalize(glm::dvec3(g.axis)), g.sharpness,
                          glm::vec3(g.amplitude * sg_mass(g.sharpness)), upper_half});
  }
  fit.relative_error = fitter.relative_error();
  fit.irradiance_error = irradiance_error(grid, fitter.residual());
  return fit;
}

EnvironmentFit turned(EnvironmentFit fit, double turn) {
  const double c = std::cos(turn);
  const double s = std::sin(turn);
  for (SgLight& light : fit.lights) {
    const glm::dvec3 axis = light.towards;
    light.towards = {c * axis.x - s * axis.y, s * axis.x + c * axis.y, axis.z};
  }
  return fit;
}

SgLight gaussian_of(const UniformLight& light) {
  return {glm::dvec3(0, 0, 1), kLeastSharpness,
          light.radiance * static_cast<float>(sg_mass(kLeastSharpness)), light.cut_at_horizon};
}

}  // namespace weft::render
