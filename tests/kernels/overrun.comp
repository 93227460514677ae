#version 450
#extension GL_EXT_scalar_block_layout : require

// Writes where it is told to, also behind the end: what in-kernel validation must notice.
layout(local_size_x = 1) in;

layout(set = 0, binding = 0, scalar) buffer Values { uint values[]; };
layout(push_constant, scalar) uniform Push { uint index; };

void main() { values[index] = 1; }
