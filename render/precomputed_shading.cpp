#include "render/precomputed_fabric.h"

// Local shading: the shared text of shading/, with the tables of the database.

namespace weft::render {

using shading::ShVector;
using shading::SphericalGaussian;

glm::vec3 PrecomputedFabric::unoccluded_directional(const ShadingPoint& at, glm::vec3 omega_d) {
  return shading::unoccluded_directional(at, at.bcsdf->lobes(), omega_d);
}

glm::vec3 PrecomputedFabric::unoccluded_sg(const ShadingPoint& at,
                                           const SphericalGaussian& light) const {
  return shading::unoccluded_gaussian(at, at.bcsdf->lobes(), light, settings_.gamma_method);
}

glm::vec3 PrecomputedFabric::single_directional(const ShadingPoint& at, glm::vec3 omega_d) const {
  return shading::single_directional(tables(), static_cast<int>(at.segment), at, at.bcsdf->lobes(),
                                     omega_d);
}

glm::vec3 PrecomputedFabric::single_sg(const ShadingPoint& at,
                                       const SphericalGaussian& light) const {
  return single_sg(at, light, settings_);
}

glm::vec3 PrecomputedFabric::single_sg(const ShadingPoint& at, const SphericalGaussian& light,
                                       const PrecomputedSettings& settings) const {
  return shading::single_gaussian(tables(), static_cast<int>(at.segment), at, at.bcsdf->lobes(),
                                  light,
                                  {settings.blend_low, settings.blend_high, settings.gamma_method});
}

CellRadiance PrecomputedFabric::light_cells(const ShVector& c_light) const {
  const shading::FabricTables all = tables();
  CellRadiance light;
  light.c_t.reserve(db_.cell_paths.size() * 3);
  for (std::size_t cell = 0; cell < db_.cell_paths.size(); ++cell) {
    for (int channel = 0; channel < 3; ++channel) {
      light.c_t.push_back(shading::transferred(all, static_cast<int>(cell), channel, c_light));
    }
  }
  return light;
}

glm::vec3 PrecomputedFabric::multiple(const ShadingPoint& at, const CellRadiance& light) const {
  const ShVector* c_t = light.c_t.data() + std::size_t{db_.cell_of_segment[at.segment]} * 3;
  return {shading::sh_dot(at.c_s[0], c_t[0]), shading::sh_dot(at.c_s[1], c_t[1]),
          shading::sh_dot(at.c_s[2], c_t[2])};
}

glm::vec3 PrecomputedFabric::multiple(const ShadingPoint& at, const ShVector& c_light) const {
  const shading::FabricTables all = tables();
  const auto cell = static_cast<int>(db_.cell_of_segment[at.segment]);
  glm::vec3 radiance(0);
  for (int channel = 0; channel < 3; ++channel) {
    radiance[channel] = shading::sh_dot(at.c_s[static_cast<std::size_t>(channel)],
                                        shading::transferred(all, cell, channel, c_light));
  }
  return radiance;
}

ShVector harmonics_of_directional(glm::vec3 omega_d) {
  return shading::harmonics_of_direction(omega_d);
}

ShVector harmonics_of_sg(const SphericalGaussian& light) {
  return shading::harmonics_of_gaussian(light);
}

}  // namespace weft::render
