#version 450
#extension GL_EXT_scalar_block_layout : require

// Answers every question of solid_queries.h.
layout(local_size_x = 64) in;

#define SOLID_BINDING 0
#include "render/kernels/solid.glsl"

#include "tests/kernels/solid_queries.h"

layout(set = 0, binding = 5, scalar) readonly buffer Queries { SolidQuery queries[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer Answers { SolidAnswer answers[]; };
layout(push_constant, scalar) uniform Push { uint count; int cloths; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < count) {
    answers[i] = solid_answer(kGeometry, cloths, queries[i]);
  }
}
