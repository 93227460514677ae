#version 450
#extension GL_EXT_scalar_block_layout : require

// Eight independent chains of multiply-adds in each invocation.
layout(local_size_x = 128) in;

layout(set = 0, binding = 0, scalar) writeonly buffer Results { float results[]; };
layout(push_constant, scalar) uniform Push { uint rounds; float factor; float term; };

void main() {
  float seed = float(gl_GlobalInvocationID.x) * 1e-6;
  vec4 a = vec4(seed, seed + 1.0, seed + 2.0, seed + 3.0);
  vec4 b = a + 4.0;
  vec4 m = vec4(factor);
  vec4 t = vec4(term);
  for (uint k = 0; k < rounds; ++k) {
    a = fma(a, m, t);
    b = fma(b, m, t);
    a = fma(a, m, t);
    b = fma(b, m, t);
    a = fma(a, m, t);
    b = fma(b, m, t);
    a = fma(a, m, t);
    b = fma(b, m, t);
  }
  vec4 sum = a + b;
  results[gl_GlobalInvocationID.x] = sum.x + sum.y + sum.z + sum.w;
}
