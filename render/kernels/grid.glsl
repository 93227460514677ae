// Buffers of render/kernels/walk.h for a kernel: define GRID_BINDING, the first of the eight
// bindings that they take, beside SOLID_BINDING (solid.glsl), and include this.
// gpu::DeviceGeometry::grid_buffers() has them in order.
#ifndef WEFT_RENDER_KERNELS_GRID_GLSL
#define WEFT_RENDER_KERNELS_GRID_GLSL

#include "render/kernels/solid.glsl"

#include "render/kernels/grid_records.h"

layout(set = 0, binding = GRID_BINDING, scalar) readonly buffer FabricBuffer {
  DeviceFabric device_fabrics[];
};
layout(set = 0, binding = GRID_BINDING + 1, scalar) readonly buffer BrickBuffer {
  int device_bricks[];
};
layout(set = 0, binding = GRID_BINDING + 2, scalar) readonly buffer VoxelBuffer {
  uint device_voxels[];
};
layout(set = 0, binding = GRID_BINDING + 3, scalar) readonly buffer EntryBuffer {
  uint device_entries[];
};
layout(set = 0, binding = GRID_BINDING + 4, scalar) readonly buffer CapsuleBuffer {
  DeviceCapsule device_capsules[];
};
layout(set = 0, binding = GRID_BINDING + 5, scalar) readonly buffer SegmentBuffer {
  uint device_segments[];
};
layout(set = 0, binding = GRID_BINDING + 6, scalar) readonly buffer NearestBuffer {
  uint device_nearest[];
};
layout(set = 0, binding = GRID_BINDING + 7, scalar) readonly buffer PatternBuffer {
  int device_patterns[];
};

DeviceFabric fabric_at(Geometry g, int index) { return device_fabrics[index]; }
int brick_at(Geometry g, int index) { return device_bricks[index]; }
uint voxel_at(Geometry g, int index) { return device_voxels[index]; }
uint entry_at(Geometry g, uint index) { return device_entries[index]; }
DeviceCapsule capsule_at(Geometry g, int index) { return device_capsules[index]; }
int segment_at(Geometry g, int index) { return int(device_segments[index]); }
int nearest_at(Geometry g, int index) { return int(device_nearest[index]) - 1; }
int pattern_at(Geometry g, int index) { return device_patterns[index]; }

#include "render/kernels/eye_ray.h"

#endif
