// Shared text (C++20 and GLSL): light that was scattered more than once, c_S . (D(R) A c_light)
// (Khungurn et al. 2017, section 5.3). The truncated and noisy series may fall below zero: cutting
// it here would make its mean too bright, so that only whole pixels are cut.
#ifndef WEFT_SHADING_MULTIPLE_SCATTERING_H
#define WEFT_SHADING_MULTIPLE_SCATTERING_H

#include "shading/dialect.h"
#include "shading/fibre_angle.h"
#include "shading/gaussian_visibility.h"
#include "shading/sh_rotation.h"
#include "shading/spherical_harmonics.h"
#ifndef WEFT_SHADING_FABRIC_TABLES
#include "shading/fabric_tables.h"
#endif

SHARED_BEGIN

const int kCsAngles = 512;  // rows of C_S over theta_o

// Where theta_o lies in the table of C_S.
struct CsPlace {
  int row;
  float share;  // of the next row
};

SHARED CsPlace c_s_place(float theta_o) {
  float t = clamp((theta_o + kHalfPi) / kPi, 0.0f, 1.0f) * float(kCsAngles - 1);
  CsPlace place;
  place.row = min(int(t), kCsAngles - 2);
  place.share = t - float(place.row);
  return place;
}

// C_S of one channel in omega_o-space, interpolated linearly in theta_o.
SHARED ShVector c_s_at(FabricTables tables, int material, int channel, CsPlace place) {
  FabricSizes sizes = fabric_sizes(tables);
  ShVector c = sh_zero();
  for (int row = 0; row < 6; ++row) {
    for (int k = 0; k < 6; ++k) {
      int j = 6 * row + k;
      if (j < sizes.harmonics) {
        float low = c_s_entry(tables, material, channel, place.row, j);
        float high = c_s_entry(tables, material, channel, place.row + 1, j);
        c.c[j] = low + place.share * (high - low);
      }
    }
  }
  return c;
}

// The turn from omega_o-space to the flat fabric.
SHARED ShRotation sh_rotation_to_flat(SeenFibre seen) {
  mat3 m = seen.to_fibre;
  return sh_rotation(mat3(vec3(m[0][0], m[1][0], m[2][0]), vec3(m[0][1], m[1][1], m[2][1]),
                          vec3(m[0][2], m[1][2], m[2][2])));
}

// c_T = A c_light of one cell and channel.
SHARED ShVector transferred(FabricTables tables, int cell, int channel, ShVector c_light) {
  FabricSizes sizes = fabric_sizes(tables);
  ShVector c_t = sh_zero();
  for (int quad = 0; 4 * quad < sizes.harmonics; ++quad) {
    vec4 sum = vec4(0.0f, 0.0f, 0.0f, 0.0f);
    for (int j0 = 0; j0 < sizes.harmonics; ++j0) {
      sum += transfer_rows(tables, cell, channel, j0, quad) * c_light.c[j0];
    }
    int j1 = 4 * quad;
    c_t.c[j1] = sum.x;
    c_t.c[j1 + 1] = sum.y;
    c_t.c[j1 + 2] = sum.z;
    c_t.c[j1 + 3] = sum.w;
  }
  return c_t;
}

SHARED_END

#endif
