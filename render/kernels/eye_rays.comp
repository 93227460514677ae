#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require

// Follows the eye rays of a rectangle of pixels to the first fibre (render/gpu/eye_rays.h).

#define SOLID_BINDING 0
#define GRID_BINDING 5
#include "render/kernels/grid.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 13, scalar) buffer HitBuffer { DeviceHit hits[]; };
layout(set = 0, binding = 14, scalar) buffer SearchBuffer { EyeSearch searches[]; };
layout(set = 0, binding = 15, scalar) buffer UnfinishedBuffer { uint unfinished; };

layout(push_constant, scalar) uniform Push { EyeTask task; };

void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= task.columns * task.rows * task.sample_count) {
    return;
  }
  EyeRay ray = eye_ray(task, i);
  EyeProgress progress = eye_begin(ray);
  if (task.resumes != 0) {
    progress.search = searches[i];
    progress.hit = hits[i];
  }
  if (progress.search.cloth < task.cloths) {
    progress = eye_on(kGeometry, task.cloths, ray, progress, task.nearest_samples);
    if (progress.search.cloth < task.cloths) {
      atomicAdd(unfinished, 1u);
    }
  }
  searches[i] = progress.search;
  hits[i] = progress.hit;
}
