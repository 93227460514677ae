// Shared text (C++20 and GLSL): rays against the outside of a shell, through a hierarchy of boxes.
// The including program defines the type Geometry and cloth_at, node_at and outer_face_at.
#ifndef WEFT_RENDER_KERNELS_OUTSIDE_H
#define WEFT_RENDER_KERNELS_OUTSIDE_H

#include "render/kernels/cloth_records.h"

SHARED_BEGIN

const float kFarMm = 1e30f;
// Deeper than any hierarchy that render/gpu/bounds_tree.cpp builds.
const int kTreeStack = 48;

// A ray in the frame of one piece of cloth. Its origin is the point of the ray nearest to the
// piece's centre, at `moved_mm` along the ray: what is lost there is lost once, not at each use.
struct LocalRay {
  vec3 origin_mm;
  vec3 direction;
  vec3 inverse;  // of the direction
  float moved_mm;
};

SHARED float inverse_of(float x) {
  return abs(x) < 1e-20f ? (x < 0.0f ? -1e20f : 1e20f) : 1.0f / x;
}

SHARED LocalRay local_ray(vec3 centre_mm, vec3 origin_mm, vec3 direction) {
  LocalRay ray;
  vec3 from = origin_mm - centre_mm;
  ray.moved_mm = -dot(from, direction);
  ray.origin_mm =
      vec3(fma(ray.moved_mm, direction.x, from.x), fma(ray.moved_mm, direction.y, from.y),
           fma(ray.moved_mm, direction.z, from.z));
  ray.direction = direction;
  ray.inverse = vec3(inverse_of(direction.x), inverse_of(direction.y), inverse_of(direction.z));
  return ray;
}

SHARED vec3 point_at(LocalRay ray, float t_mm) { return ray.origin_mm + t_mm * ray.direction; }

struct OuterHit {
  float t_mm;  // along the local ray
  int face;    // counted from the piece's first; -1: none
  int steps;   // from box to box that it took
};

// Where a ray meets a box, as (enter, leave); it misses where enter > leave. Slabs after Kay and
// Kajiya 1986, widened by rounding.
SHARED vec2 box_passage(LocalRay ray, vec3 low_mm, vec3 high_mm) {
  vec3 a = (low_mm - ray.origin_mm) * ray.inverse;
  vec3 b = (high_mm - ray.origin_mm) * ray.inverse;
  vec3 entries = min(a, b);
  vec3 exits = max(a, b);
  return vec2(max(max(entries.x, entries.y), entries.z),
              min(min(exits.x, exits.y), exits.z) * 1.0000004f);
}

// The distance at which a ray meets a triangle from either side; kFarMm when it does not.
// Möller and Trumbore 1997, with edges that reach out by rounding, so that no ray slips between
// neighbours.
SHARED float triangle_distance(LocalRay ray, DeviceOuterFace face) {
  vec3 ab = face.b_mm - face.a_mm;
  vec3 ac = face.c_mm - face.a_mm;
  vec3 p = cross(ray.direction, ac);
  float determinant = dot(ab, p);
  if (determinant == 0.0f) {
    return kFarMm;
  }
  float inverse = 1.0f / determinant;
  vec3 from = ray.origin_mm - face.a_mm;
  float u = dot(from, p) * inverse;
  vec3 q = cross(from, ab);
  float v = dot(ray.direction, q) * inverse;
  const float outside = -1e-5f;
  if (!(u >= outside && v >= outside && u + v <= 1.0f - outside)) {
    return kFarMm;
  }
  return dot(ac, q) * inverse;
}

// The first face between two distances along the local ray, or with `any` some face there.
SHARED OuterHit outer_face_between(Geometry g, int cloth, LocalRay ray, vec2 span_mm, bool any) {
  DeviceCloth piece = cloth_at(g, cloth);
  OuterHit nearest;
  nearest.t_mm = span_mm.y;
  nearest.face = -1;
  nearest.steps = 0;
  int stack[kTreeStack];
  int depth = 1;
  stack[0] = 0;
  while (depth > 0 && !(any && nearest.face >= 0)) {
    --depth;
    ++nearest.steps;
    DeviceNode node = node_at(g, piece.first_node + stack[depth]);
    vec2 passage = box_passage(ray, node.low_mm, node.high_mm);
    if (!(passage.x <= passage.y) || passage.x > nearest.t_mm || passage.y < span_mm.x) {
      continue;
    }
    for (int i = 0; i < node.count; ++i) {
      float t = triangle_distance(ray, outer_face_at(g, piece.first_face + node.first + i));
      if (t >= span_mm.x && t < nearest.t_mm) {
        nearest.t_mm = t;
        nearest.face = node.first + i;
      }
    }
    if (node.count < 0 && depth + 2 <= kTreeStack) {
      // The child that lies nearer along the ray is taken from the stack first.
      int nearer = ray.direction[-1 - node.count] >= 0.0f ? 0 : 1;
      stack[depth] = node.first + 1 - nearer;
      stack[depth + 1] = node.first + nearer;
      depth += 2;
    }
  }
  return nearest;
}

SHARED_END

#endif
