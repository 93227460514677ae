// Shared text (C++20 and GLSL): a question about cloth as a solid and what solid.h answers. The
// including program defines what solid.h asks for.
#ifndef WEFT_TESTS_KERNELS_SOLID_QUERIES_H
#define WEFT_TESTS_KERNELS_SOLID_QUERIES_H

#include "render/kernels/solid.h"

SHARED_BEGIN

struct SolidQuery {
  int cloth;
  int place;
  vec3 origin_mm;
  vec3 direction;
  float t_max_mm;
  vec3 flat_mm;
  vec2 offset_mm;
};

struct SolidAnswer {
  int cloth_blocks;
  int any_blocks;
  int top_exists;
  vec3 top_mm;
  mat3 rotation;
};

SHARED SolidAnswer solid_answer(Geometry g, int cloths, SolidQuery q) {
  SolidAnswer r;
  r.cloth_blocks = cloth_blocks(g, q.cloth, q.origin_mm, q.direction, q.t_max_mm) ? 1 : 0;
  r.any_blocks = blocked_by_cloth(g, cloths, q.origin_mm, q.direction, q.t_max_mm) ? 1 : 0;
  TopPoint top = top_point(g, q.cloth, q.place, q.flat_mm, q.offset_mm);
  r.top_exists = top.exists ? 1 : 0;
  r.top_mm = top.world_mm;
  r.rotation = rotation_at(g, q.cloth, q.place);
  return r;
}

SHARED_END

#endif
