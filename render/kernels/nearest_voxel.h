// Shared text (C++20 and GLSL): the paper's way to find a fibre (Khungurn et al. 2017, section
// 5.1): a volume whose voxels name the segment with the nearest midpoint, looked up at a fixed
// number of points. The including program defines the type Geometry and nearest_at.
#ifndef WEFT_RENDER_KERNELS_NEAREST_VOXEL_H
#define WEFT_RENDER_KERNELS_NEAREST_VOXEL_H

#include "render/kernels/grid_march.h"

SHARED_BEGIN

// The segment whose voxel a point of a fabric's tile lies in; -1: none. REQUIRES: the fabric has
// the volume.
SHARED int nearest_segment(Geometry g, DeviceFabric fabric, vec3 at_mm) {
  vec3 low = vec3(0.0f, 0.0f, fabric.z_low_mm);
  vec3 size = vec3(fabric.size_mm.x, fabric.size_mm.y, fabric.z_high_mm - fabric.z_low_mm);
  vec3 in_tile = vec3(wrapped(at_mm.x, size.x), wrapped(at_mm.y, size.y), at_mm.z);
  ivec3 voxel = ivec3(floor((in_tile - low) / size * vec3(fabric.nearest_voxels)));
  if (voxel.z < 0 || voxel.z >= fabric.nearest_voxels.z) {
    return -1;
  }
  // Rounding may wrap a point to the tile's far border itself.
  voxel.x = min(voxel.x, fabric.nearest_voxels.x - 1);
  voxel.y = min(voxel.y, fabric.nearest_voxels.y - 1);
  return nearest_at(g, fabric.first_nearest + voxel.x +
                           fabric.nearest_voxels.x * (voxel.y + fabric.nearest_voxels.y * voxel.z));
}

SHARED_END

#endif
