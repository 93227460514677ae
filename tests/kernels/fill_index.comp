#version 450
#extension GL_EXT_scalar_block_layout : require

// values[i] = scale * i + offset[i], by as many groups as it takes.
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint kScale = 1;

layout(set = 0, binding = 0, scalar) readonly buffer Offsets { uint offsets[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Values { uint values[]; };
layout(push_constant, scalar) uniform Push { uint count; };

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < count) {
    values[i] = kScale * i + offsets[i];
  }
}
