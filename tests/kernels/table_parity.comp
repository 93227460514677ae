#version 450
#extension GL_EXT_scalar_block_layout : require

// Answers every question of table_queries.h.
layout(local_size_x = 64) in;

#define FABRIC_BINDING 0
#include "render/kernels/fabric_buffers.glsl"
#define TRANSFER_BINDING 6
#include "render/kernels/transfer_buffers.glsl"

FibreLobes lobes_of_segment(int segment) { return lobes_of(material_of(segment)); }

#include "tests/kernels/table_queries.h"

layout(set = 0, binding = 7, scalar) readonly buffer Queries { TableQuery queries[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer Answers { TableAnswer answers[]; };
layout(push_constant, scalar) uniform Push { uint count; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < count) {
    answers[i] = table_answer(kFabric, queries[i]);
  }
}
