// Shared text (C++20 and GLSL): where an eye ray met a fibre, as the kernel that follows eye rays
// hands it to the kernel that shades. Scalar block layout.
#ifndef WEFT_RENDER_KERNELS_HIT_H
#define WEFT_RENDER_KERNELS_HIT_H

#include "shading/dialect.h"

SHARED_BEGIN

const int kHitNothing = 0;  // the background is seen
const int kHitFibre = 1;
const int kHitAbsorbed = 2;  // black sheet

struct DeviceHit {
  int fate;
  int cloth;    // index of the piece of cloth in the scene
  int fabric;   // index of the fabric that shows here (patterned cloth has several)
  int place;    // tetrahedron of the shell; -1 on a flat piece
  int segment;  // of the fabric's tile
  float t_mm;   // along the eye ray
  vec3 world_mm;
  vec3 flat_mm;  // in the flat fabric, endless
  vec3 to_eye;   // unit, in the world
};

SHARED_END

#endif
