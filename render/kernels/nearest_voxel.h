// Shared text (C++20 and GLSL): the paper's way to find a fibre (Khungurn et al. 2017, section
// 5.1): a volume whose voxels name the segment with the nearest midpoint, looked up at a fixed
// number of points. The including program defines the type Geometry and nearest_at.
#ifndef WEFT_RENDER_KERNELS_NEAREST_VOXEL_H
#define WEFT_RENDER_KERNELS_NEAREST_VOXEL_H

#include "render/kernels/grid_march.h"

SHARED_BEGIN

// `capsule` of what this returns is a segment of the tile. REQUIRES: the fabric has the volume.
SHARED FlatMeeting sample_nearest(Geometry g, DeviceFabric fabric, FlatLine line, int samples) {
  FlatMeeting meeting;
  meeting.capsule = -1;
  meeting.distance_mm = line.length_mm;
  meeting.finished = true;
  meeting.reached_mm = line.length_mm;
  meeting.steps = 0;
  vec3 low = vec3(0.0f, 0.0f, fabric.z_low_mm);
  vec3 size = vec3(fabric.size_mm.x, fabric.size_mm.y, fabric.z_high_mm - fabric.z_low_mm);
  float spacing = line.length_mm / float(samples);
  while (meeting.steps < samples && meeting.capsule < 0) {
    float t = (float(meeting.steps) + 0.5f) * spacing;
    vec3 at = line.start_mm + t * line.direction;
    at = vec3(wrapped(at.x, fabric.size_mm.x), wrapped(at.y, fabric.size_mm.y), at.z);
    ivec3 voxel = ivec3(floor((at - low) / size * vec3(fabric.nearest_voxels)));
    // Rounding may wrap a point to the tile's far border itself.
    voxel.x = min(voxel.x, fabric.nearest_voxels.x - 1);
    voxel.y = min(voxel.y, fabric.nearest_voxels.y - 1);
    if (voxel.z >= 0 && voxel.z < fabric.nearest_voxels.z) {
      meeting.capsule = nearest_at(
          g, fabric.first_nearest + voxel.x +
                 fabric.nearest_voxels.x * (voxel.y + fabric.nearest_voxels.y * voxel.z));
      meeting.distance_mm = t;
    }
    ++meeting.steps;
  }
  return meeting;
}

SHARED_END

#endif
