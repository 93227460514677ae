#version 450
#extension GL_EXT_scalar_block_layout : require

// Runs one case of parity_cases.h over all inputs.
layout(local_size_x = 64) in;
layout(constant_id = 0) const int kCase = 0;

#include "shading/bcsdf.h"

FibreLobes parity_lobes(int material);

#include "tests/kernels/parity_cases.h"

layout(set = 0, binding = 0, scalar) readonly buffer Inputs { ParityInput inputs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Outputs { ParityOutput outputs[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Materials { FibreLobes materials[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Entries { vec2 entries[]; };
layout(push_constant, scalar) uniform Push { uint count; };

FibreLobes parity_lobes(int material) { return materials[material]; }
vec2 lobe_table_entry(LobeTable table, int index) { return entries[table + index]; }

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < count) {
    outputs[i] = parity_case(kCase, inputs[i]);
  }
}
