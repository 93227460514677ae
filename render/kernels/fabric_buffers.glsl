// Buffers of one fabric for a kernel: define FABRIC_BINDING, the first of the six bindings that they
// take, and include this. gpu::DeviceFabricTables::buffers() has them in order.
#ifndef WEFT_RENDER_KERNELS_FABRIC_BUFFERS_GLSL
#define WEFT_RENDER_KERNELS_FABRIC_BUFFERS_GLSL

#include "render/kernels/shading_records.h"
#include "shading/dialect.h"

#define WEFT_SHADING_FABRIC_TABLES
#define FabricTables int
const FabricTables kFabric = 0;  // the only one that a kernel has

layout(set = 0, binding = FABRIC_BINDING, scalar) readonly buffer FabricBuffer {
  DeviceFabricSizes device_fabric_sizes;
};
layout(set = 0, binding = FABRIC_BINDING + 1, scalar) readonly buffer FabricFloatBuffer {
  float fabric_floats[];
};
layout(set = 0, binding = FABRIC_BINDING + 2, scalar) readonly buffer SegmentBuffer {
  DeviceSegment device_segments[];
};
// Pairs of halves: [pixels, ssdf_pairs], [segments, ssdf_pairs], [segments, (gaussians + 1) / 2].
layout(set = 0, binding = FABRIC_BINDING + 3, scalar) readonly buffer BasisBuffer {
  uint ssdf_basis_words[];
};
layout(set = 0, binding = FABRIC_BINDING + 4, scalar) readonly buffer FactorBuffer {
  uint ssdf_factor_words[];
};
layout(set = 0, binding = FABRIC_BINDING + 5, scalar) readonly buffer GaussianBuffer {
  uint gaussian_words[];
};

struct FabricSizes {
  int resolution;
  int ssdf_pairs;
  int gaussians;
  float sharpness;
  int harmonics;
};

FabricSizes fabric_sizes(FabricTables t) {
  return FabricSizes(device_fabric_sizes.resolution, device_fabric_sizes.ssdf_pairs, device_fabric_sizes.gaussians,
                     device_fabric_sizes.sharpness, device_fabric_sizes.harmonics);
}

float open_share(FabricTables t, int segment) { return device_segments[segment].open_share; }

vec2 ssdf_basis(FabricTables t, int pixel, int pair) {
  return unpackHalf2x16(ssdf_basis_words[pixel * device_fabric_sizes.ssdf_pairs + pair]);
}
vec2 ssdf_factors(FabricTables t, int segment, int pair) {
  return unpackHalf2x16(ssdf_factor_words[segment * device_fabric_sizes.ssdf_pairs + pair]);
}

float gaussian_weight(FabricTables t, int segment, int q) {
  int words = (device_fabric_sizes.gaussians + 1) / 2;
  vec2 pair = unpackHalf2x16(gaussian_words[segment * words + q / 2]);
  return (q & 1) == 0 ? pair.x : pair.y;
}
vec3 fabric_vec3(int first) {
  return vec3(fabric_floats[first], fabric_floats[first + 1], fabric_floats[first + 2]);
}
vec3 gaussian_axis(FabricTables t, int q) { return fabric_vec3(device_fabric_sizes.first_axis + 3 * q); }
int gaussian_rotation(FabricTables t, int segment) {
  return int(device_segments[segment].material_and_rotation & 0xffffu);
}
int material_of(int segment) {
  return int(device_segments[segment].material_and_rotation >> 16);
}

vec2 lobe_table_entry(LobeTable table, int index) {
  int at = table + 2 * index;
  return vec2(fabric_floats[at], fabric_floats[at + 1]);
}

float c_s_entry(FabricTables t, int material, int channel, int row, int j) {
  int rows = (material * 3 + channel) * 512 + row;
  return fabric_floats[device_fabric_sizes.first_c_s + rows * device_fabric_sizes.harmonics + j];
}

#include "shading/bcsdf.h"

FibreLobes lobes_of(int material) {
  int at = device_fabric_sizes.first_material + material * kMaterialFloats;
  FibreLobes lobes;
  lobes.c_r = fabric_vec3(at);
  lobes.c_tt = fabric_vec3(at + 3);
  lobes.precision_r = fabric_floats[at + 6];
  lobes.precision_tt = fabric_floats[at + 7];
  lobes.kappa_tt = fabric_floats[at + 8];
  lobes.azimuth_norm = fabric_floats[at + 9];
  lobes.table = device_fabric_sizes.first_lobe + material * 2 * (kLobeTableCells + 1);
  return lobes;
}

#endif
