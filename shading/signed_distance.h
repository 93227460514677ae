// Shared text (C++20 and GLSL): the signed distance of a segment's visibility, decoded from its
// principal components (Khungurn et al. 2017, section 4.1).
#ifndef WEFT_SHADING_SIGNED_DISTANCE_H
#define WEFT_SHADING_SIGNED_DISTANCE_H

#include "shading/dialect.h"
#include "shading/fibre_angle.h"
#include "shading/visibility.h"
#ifndef WEFT_SHADING_FABRIC_TABLES
#include "shading/fabric_tables.h"
#endif

SHARED_BEGIN

// Angle of omega above the horizon of the flat fabric, radians.
SHARED float elevation(vec3 omega) { return fibre_angle(vec3(omega.z, omega.x, omega.y)).theta; }

// Angle from omega to the nearest edge of what the segment sees, radians, negative where it sees
// nothing; at most the angle to the horizon, -pi for segments that see nothing.
SHARED float signed_distance(FabricTables tables, int segment, vec3 omega) {
  float share = open_share(tables, segment);
  if (share <= 0.0f) {
    return -kPi;
  }
  float above_horizon = elevation(omega);
  if (share >= 1.0f) {
    return above_horizon;
  }
  FabricSizes sizes = fabric_sizes(tables);
  MapFootprint at = map_footprint(omega, sizes.resolution);
  float distance = 0.0f;
  for (int pair = 0; pair < sizes.ssdf_pairs; ++pair) {
    vec2 value = ssdf_basis(tables, at.index[0], pair) * at.weight[0] +
                 ssdf_basis(tables, at.index[1], pair) * at.weight[1] +
                 ssdf_basis(tables, at.index[2], pair) * at.weight[2] +
                 ssdf_basis(tables, at.index[3], pair) * at.weight[3];
    vec2 factors = ssdf_factors(tables, segment, pair);
    distance += value.x * factors.x;
    distance += value.y * factors.y;
  }
  return min(distance, above_horizon);
}

// V = [signed distance > 0], and nothing below the horizon.
SHARED bool segment_sees(FabricTables tables, int segment, vec3 omega) {
  if (!(omega.z > 0.0f)) {
    return false;
  }
  return signed_distance(tables, segment, omega) > 0.0f;
}

SHARED_END

#endif
