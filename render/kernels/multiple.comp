// Multiple scattering of all lights at once: what arrives at a hit, behind the transfer of its cell,
// through the harmonics of its fibre (Khungurn et al. 2017, section 5.3). The transfer is linear, so
// that one product serves any number of lights.
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

layout(set = 0, binding = 12, scalar) readonly buffer HitBuffer { DeviceHit hits[]; };
layout(set = 0, binding = 13, scalar) buffer SampleBuffer { DeviceSample samples[]; };
layout(set = 0, binding = 14, scalar) readonly buffer ArrivingBuffer { float arriving[]; };

void main() {
  uint item = gl_GlobalInvocationID.x;
  if (item >= batch_items(call.batch) || !is_of_call(hits[item])) {
    return;
  }
  DeviceHit hit = hits[item];
  DeviceSegment segment = device_segments[hit.segment];
  int cell = int(segment.cell) - call.first_cell;
  if (cell < 0 || cell >= call.cells) {
    return;
  }
  vec3 omega_o = normalize(rotation_at(kGeometry, hit.cloth, hit.place) * hit.to_eye);
  SeenFibre seen = seen_fibre(segment.tangent, omega_o);
  ShRotation to_flat = sh_rotation_to_flat(seen);
  CsPlace place = c_s_place(fibre_angle(seen.omega_o).theta);
  int material = material_of(hit.segment);
  int harmonics = device_fabric_sizes.harmonics;
  vec3 radiance = vec3(0.0f);
  for (int channel = 0; channel < 3; ++channel) {
    ShVector c = sh_zero();
    for (int row = 0; row < 6; ++row) {
      for (int k = 0; k < 6; ++k) {
        int j = 6 * row + k;
        if (j < harmonics) {
          c.c[j] = arriving[arriving_index(item, channel, j, harmonics)];
        }
      }
    }
    if (call.transferred == 0) {
      c = transferred(kFabric, cell, channel, c);
    }
    radiance[channel] = sh_dot(sh_rotate(to_flat, c_s_at(kFabric, material, channel, place)), c);
  }
  samples[item].multiple = radiance;
}
