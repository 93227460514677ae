// Shared text (C++20 and GLSL): lights as spherical harmonics.
#ifndef WEFT_SHADING_LIGHT_HARMONICS_H
#define WEFT_SHADING_LIGHT_HARMONICS_H

#include "shading/dialect.h"
#include "shading/spherical_gaussian.h"
#include "shading/spherical_harmonics.h"

SHARED_BEGIN

// Of a light of unit irradiance from omega_d of the flat fabric; none from below its horizon.
SHARED ShVector harmonics_of_direction(vec3 omega_d) {
  if (omega_d.z > 0.0f) {
    return sh_evaluate(omega_d);
  }
  return sh_zero();
}

// ... of a normalised Gaussian light.
SHARED ShVector harmonics_of_gaussian(SphericalGaussian light) {
  return sh_zonal_about(sg_zonal(light.sharpness), light.axis);
}

SHARED_END

#endif
