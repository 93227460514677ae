#version 450
#extension GL_EXT_scalar_block_layout : require

// One shadow ray for each hit, from the upper surface above it: the share that shadows have of the
// kernels of light.
layout(local_size_x = 64) in;

#include "render/kernels/hit.h"
#define SOLID_BINDING 0
#include "render/kernels/solid.glsl"

layout(set = 0, binding = 5, scalar) readonly buffer Hits { DeviceHit hits[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer Blocked { uint blocked[]; };
layout(push_constant, scalar) uniform Push { vec3 to_light; uint count; int cloths; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= count || hits[i].fate != kHitFibre) {
    return;
  }
  DeviceHit hit = hits[i];
  TopPoint top = top_point(kGeometry, hit.cloth, hit.place, hit.flat_mm, vec2(0.0f, 0.0f));
  vec3 from = top.exists ? top.world_mm : hit.world_mm;
  blocked[i] = blocked_by_cloth(kGeometry, cloths, from, to_light, 1e30f) ? 1 : 0;
}
