#version 450
#extension GL_EXT_scalar_block_layout : require

// Copies quads of words; neighbouring invocations touch neighbouring quads.
layout(local_size_x = 128) in;

layout(set = 0, binding = 0, scalar) readonly buffer From { uvec4 from[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer To { uvec4 to[]; };
layout(push_constant, scalar) uniform Push { uint count; uint per_invocation; };

void main() {
  uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
  uint i = gl_GlobalInvocationID.x;
  for (uint k = 0; k < per_invocation && i < count; ++k) {
    to[i] = from[i];
    i += stride;
  }
}
