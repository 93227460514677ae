// c_T = A c_light of every cell and channel, once for a light that comes from one direction of the
// flat fabric everywhere.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "render/kernels/batch.glsl"
#define SOLID_BINDING 0
#include "render/kernels/solid.glsl"
#define FABRIC_BINDING 5
#include "render/kernels/fabric_buffers.glsl"
#define TRANSFER_BINDING 11
#include "render/kernels/transfer_buffers.glsl"
#include "shading/light_harmonics.h"

layout(set = 0, binding = 12, scalar) readonly buffer LightBuffer { DeviceLight lights[]; };
layout(set = 0, binding = 13, scalar) writeonly buffer CellBuffer { float cell_radiance[]; };

void main() {
  int cell = int(gl_GlobalInvocationID.x) / 3;
  int channel = int(gl_GlobalInvocationID.x) - 3 * cell;
  if (cell >= call.cells) {
    return;
  }
  DeviceLight light = lights[call.light];
  vec3 towards = normalize(rotation_at(kGeometry, call.cloth, 0) * light.place);
  ShVector c_light;
  if (light.kind == kLightGaussian) {
    SphericalGaussian local;
    local.axis = towards;
    local.sharpness = light.sharpness;
    c_light = harmonics_of_gaussian(local);
  } else {
    c_light = harmonics_of_direction(towards);
  }
  cell += call.first_of_page;
  ShVector c_t = transferred(kFabric, cell, channel, c_light);
  int harmonics = device_fabric_sizes.harmonics;
  int first = ((call.first_cell + cell) * 3 + channel) * harmonics;
  for (int j = 0; j < harmonics; ++j) {
    cell_radiance[first + j] = c_t.c[j];
  }
}
