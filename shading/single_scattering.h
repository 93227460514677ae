// Shared text (C++20 and GLSL): light that one fibre of precomputed cloth scatters once (Khungurn
// et al. 2017, section 5.2). Directions are unit vectors of the flat fabric that point away from
// the fibre; results are RGB per unit of irradiance on a plane that faces the light. Light from
// below the horizon counts nothing.
#ifndef WEFT_SHADING_SINGLE_SCATTERING_H
#define WEFT_SHADING_SINGLE_SCATTERING_H

#include "shading/dialect.h"
#include "shading/gaussian_visibility.h"
#include "shading/signed_distance.h"

SHARED_BEGIN

// S cos(theta) towards the eye, of light from omega_d that nothing blocks.
SHARED vec3 unoccluded_directional(SeenFibre seen, FibreLobes lobes, vec3 omega_d) {
  vec3 omega_i = seen.to_fibre * omega_d;
  float cos_theta_i = sqrt(omega_i.y * omega_i.y + omega_i.z * omega_i.z);
  return bcsdf(lobes, omega_i, seen.omega_o) * cos_theta_i;
}

// The same under a normalised Gaussian light.
SHARED vec3 unoccluded_gaussian(SeenFibre seen, FibreLobes lobes, SphericalGaussian light,
                                int method) {
  return gamma_of_seen(seen, lobes, light, method) / sg_mass(light.sharpness);
}

SHARED vec3 single_directional(FabricTables tables, int segment, SeenFibre seen, FibreLobes lobes,
                               vec3 omega_d) {
  if (!segment_sees(tables, segment, omega_d)) {
    return vec3(0.0f, 0.0f, 0.0f);
  }
  return unoccluded_directional(seen, lobes, omega_d);
}

// How visibility and Gamma of a Gaussian light are taken: from the sum of Gaussians up to sharpness
// blend_low, from the signed distance above blend_high, blended linearly in between.
struct GaussianShading {
  float blend_low;
  float blend_high;
  int gamma_method;
};

// Under the normalised Gaussian light G / M.
SHARED vec3 single_gaussian(FabricTables tables, int segment, SeenFibre seen, FibreLobes lobes,
                            SphericalGaussian light, GaussianShading how) {
  vec3 radiance = vec3(0.0f, 0.0f, 0.0f);
  if (open_share(tables, segment) <= 0.0f) {
    return radiance;
  }
  float share = ssdf_share(light.sharpness, how.blend_low, how.blend_high);
  if (share < 1.0f) {
    radiance +=
        single_by_gaussians(tables, segment, seen, lobes, light, how.gamma_method) * (1.0f - share);
  }
  if (share > 0.0f) {
    float visible = ssdf_visibility(signed_distance(tables, segment, light.axis), light.sharpness);
    if (visible > 0.0f) {
      radiance += unoccluded_gaussian(seen, lobes, light, how.gamma_method) * (visible * share);
    }
  }
  return radiance;
}

SHARED_END

#endif
