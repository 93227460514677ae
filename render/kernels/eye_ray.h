// Shared text (C++20 and GLSL): eye rays, as render/camera.h and render/draw.cpp have them, to the
// first fibre of any piece of cloth, as closest() of render/scene.h does. The including program
// defines what walk.h asks for.
#ifndef WEFT_RENDER_KERNELS_EYE_RAY_H
#define WEFT_RENDER_KERNELS_EYE_RAY_H

#include "render/kernels/hit.h"
#include "render/kernels/random.h"
#include "render/kernels/walk.h"

SHARED_BEGIN

// What the kernel that follows eye rays is called with: a rectangle of pixels of a picture, and
// some samples of each. Ray i is sample first_sample + i % sample_count of pixel i / sample_count
// of the rectangle, row by row.
struct EyeTask {
  vec3 position_mm;  // of the camera (Camera::Frame)
  int perspective;   // 0: orthographic
  vec3 forward;
  int width;  // of the picture
  vec3 across;
  int height;
  vec3 down;
  int cloths;
  uvec2 seed;  // low word first
  int left;
  int top;
  int columns;
  int rows;
  int first_sample;
  int sample_count;
  int resumes;          // 1: goes on with rays that were not finished
  int nearest_samples;  // 0: exact; else so many points of each stretch in the volume
};

struct EyeRay {
  vec3 origin_mm;
  vec3 direction;
};

// Where an eye ray has come: which piece it is in, and what it has met in those before.
struct EyeSearch {
  int cloth;
  Walk walk;
};

struct EyeProgress {
  EyeSearch search;
  DeviceHit hit;
};

// Vector iterations of a kernel that the software device of Mesa carries out (65,535), shared among
// the eight rays that it follows at once and may follow one after the other.
const int kEyeSteps = 6000;

SHARED EyeRay eye_ray(EyeTask task, int i) {
  int pixel = i / task.sample_count;
  int x = task.left + pixel % task.columns;
  int y = task.top + pixel / task.columns;
  RandomStream stream;
  stream.key = task.seed;
  stream.pixel = uint(y * task.width + x);
  stream.sample_index = uint(task.first_sample + i % task.sample_count);
  uvec4 words = random_words(stream, kEyeBlock);
  // Small numbers are added first: the place in the pixel keeps its last bits.
  float right = (uniform_of(words.x) + (float(x) - 0.5f * float(task.width))) / float(task.width);
  float down = (uniform_of(words.z) + (float(y) - 0.5f * float(task.height))) / float(task.height);
  vec3 offset = right * task.across + down * task.down;
  EyeRay ray;
  ray.origin_mm = task.position_mm;
  ray.direction = normalize(task.forward + offset);
  if (task.perspective == 0) {
    ray.origin_mm = task.position_mm + offset;
    ray.direction = task.forward;
  }
  return ray;
}

SHARED EyeProgress eye_begin(EyeRay ray) {
  EyeProgress progress;
  progress.search.cloth = 0;
  progress.search.walk = walk_begin(local_ray(ray.origin_mm, ray.origin_mm, ray.direction));
  progress.search.walk.state = kWalkAhead;
  progress.hit.fate = kHitNothing;
  progress.hit.cloth = -1;
  progress.hit.fabric = -1;
  progress.hit.place = -1;
  progress.hit.segment = -1;
  progress.hit.t_mm = kFarMm;
  progress.hit.world_mm = ray.origin_mm;
  progress.hit.flat_mm = vec3(0.0f, 0.0f, 0.0f);
  progress.hit.to_eye = -ray.direction;
  return progress;
}

// Takes what a finished walk through a piece has met, where that is nearer than all before.
SHARED DeviceHit nearer_hit(DeviceHit hit, Geometry g, int cloth, EyeRay ray, WalkResult result) {
  DeviceCloth piece = cloth_at(g, cloth);
  LocalRay in_world = local_ray(piece.centre_mm, ray.origin_mm, ray.direction);
  float t = result.walk.t_mm + in_world.moved_mm;
  if (result.walk.state == kWalkOver || !(t < hit.t_mm)) {
    return hit;
  }
  hit.fate = result.walk.state == kWalkHit ? kHitFibre : kHitAbsorbed;
  hit.cloth = cloth;
  hit.fabric = result.hit.fabric;
  hit.place = result.walk.place;
  hit.segment = result.hit.segment;
  hit.t_mm = t;
  hit.world_mm = piece.centre_mm + point_at(in_world, result.walk.t_mm);
  hit.flat_mm = result.hit.flat_mm;
  return hit;
}

// Goes on with an eye ray for about kEyeSteps steps. It is finished when search.cloth == cloths.
SHARED EyeProgress eye_on(Geometry g, int cloths, EyeRay ray, EyeProgress progress,
                          int nearest_samples) {
  int left = kEyeSteps;
  while (progress.search.cloth < cloths && left > 0) {
    int cloth = progress.search.cloth;
    LocalRay local = ray_of_piece(cloth_at(g, cloth), ray.origin_mm, ray.direction);
    Walk walk = progress.search.walk;
    if (walk.state == kWalkAhead) {
      walk = walk_begin(local);
    }
    WalkResult result = walk_on(g, cloth, local, walk, progress.hit.t_mm - local.moved_mm,
                                ivec2(nearest_samples, left));
    left -= result.steps + 1;
    progress.search.walk = result.walk;
    if (is_done(result.walk)) {
      progress.hit = nearer_hit(progress.hit, g, cloth, ray, result);
      progress.search.cloth = cloth + 1;
      progress.search.walk.state = kWalkAhead;
    }
  }
  return progress;
}

SHARED_END

#endif
