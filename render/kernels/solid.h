// Shared text (C++20 and GLSL): cloth as a solid, every gap between its fibres filled, for shadow
// rays, and the points of its upper surface from which they start. Does on the device what
// blocks(), top_point() and constant_rotation() of render/cloth.h do. The including program defines
// the type Geometry and cloth_at, node_at, outer_face_at, tetrahedron_at and shell_triangle_at.
#ifndef WEFT_RENDER_KERNELS_SOLID_H
#define WEFT_RENDER_KERNELS_SOLID_H

#include "render/kernels/outside.h"

SHARED_BEGIN

// A walk from triangle to triangle that takes more steps is going round in a fold.
const int kMaxTriangleSteps = 2000;

// Where a line goes through the box of a flat piece, and by which faces: the axis, and -1 where it
// never goes in or out.
struct FlatPassage {
  float enter_mm;
  float leave_mm;
  int enter_axis;
  int leave_axis;
};

SHARED FlatPassage through_slab(FlatPassage passage, int axis, float a_mm, float b_mm) {
  float enter = min(a_mm, b_mm);
  float leave = max(a_mm, b_mm);
  if (enter > passage.enter_mm) {
    passage.enter_mm = enter;
    passage.enter_axis = axis;
  }
  if (leave < passage.leave_mm) {
    passage.leave_mm = leave;
    passage.leave_axis = axis;
  }
  return passage;
}

// `flat_ray` is a local ray in the flat fabric's axes. A box shrunk by `margin_mm` on all sides.
SHARED FlatPassage flat_passage(DeviceCloth piece, LocalRay flat_ray, float margin_mm) {
  FlatPassage passage;
  passage.enter_mm = -kFarMm;
  passage.leave_mm = kFarMm;
  passage.enter_axis = -1;
  passage.leave_axis = -1;
  vec3 a = (piece.low_mm + margin_mm - flat_ray.origin_mm) * flat_ray.inverse;
  vec3 b = (piece.high_mm - margin_mm - flat_ray.origin_mm) * flat_ray.inverse;
  passage = through_slab(passage, 0, a.x, b.x);
  passage = through_slab(passage, 1, a.y, b.y);
  return through_slab(passage, 2, a.z, b.z);
}

SHARED LocalRay flat_ray_of(DeviceCloth piece, vec3 origin_mm, vec3 direction) {
  LocalRay ray = local_ray(piece.centre_mm, origin_mm, direction);
  LocalRay turned;
  turned.origin_mm = piece.to_flat * ray.origin_mm;
  turned.direction = piece.to_flat * direction;
  turned.inverse = vec3(inverse_of(turned.direction.x), inverse_of(turned.direction.y),
                        inverse_of(turned.direction.z));
  turned.moved_mm = ray.moved_mm;
  return turned;
}

// Whether one piece of cloth, as a solid, is in a ray's way before t_max_mm. A ray that starts on
// its surface and leads out of it is free. `direction` is unit.
SHARED bool cloth_blocks(Geometry g, int cloth, vec3 origin_mm, vec3 direction, float t_max_mm) {
  DeviceCloth piece = cloth_at(g, cloth);
  if (piece.kind == kClothFlat) {
    LocalRay ray = flat_ray_of(piece, origin_mm, direction);
    FlatPassage passage = flat_passage(piece, ray, piece.contact_mm);
    return min(passage.leave_mm, t_max_mm - ray.moved_mm) > max(-ray.moved_mm, passage.enter_mm);
  }
  LocalRay ray = local_ray(piece.centre_mm, origin_mm, direction);
  vec2 span = vec2(piece.contact_mm - ray.moved_mm, t_max_mm - ray.moved_mm);
  return outer_face_between(g, cloth, ray, span, true).face >= 0;
}

// Whether any of the first `cloths` pieces is.
SHARED bool blocked_by_cloth(Geometry g, int cloths, vec3 origin_mm, vec3 direction,
                             float t_max_mm) {
  bool blocked = false;
  for (int cloth = 0; cloth < cloths && !blocked; ++cloth) {
    blocked = cloth_blocks(g, cloth, origin_mm, direction, t_max_mm);
  }
  return blocked;
}

struct TopPoint {
  bool exists;
  vec3 world_mm;
};

struct Barycentric {
  bool exists;
  vec3 weights;
};

SHARED float cross_of(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }

SHARED Barycentric barycentric_in(DeviceShellTriangle triangle, vec2 flat_mm) {
  Barycentric result;
  vec2 ab = triangle.flat_1_mm - triangle.flat_0_mm;
  vec2 ac = triangle.flat_2_mm - triangle.flat_0_mm;
  vec2 from = flat_mm - triangle.flat_0_mm;
  float area = cross_of(ab, ac);
  result.exists = area != 0.0f;
  float inverse = result.exists ? 1.0f / area : 0.0f;
  float b = cross_of(from, ac) * inverse;
  float c = cross_of(ab, from) * inverse;
  result.weights = vec3(1.0f - b - c, b, c);
  return result;
}

SHARED TopPoint top_point_of_shell(Geometry g, DeviceCloth piece, int place, vec2 wanted_mm) {
  TopPoint top;
  top.exists = false;
  top.world_mm = vec3(0.0f, 0.0f, 0.0f);
  // As far out of a border as rounding may have it.
  const float edge_width = 1e-5f;
  int triangle = place / 3;
  int before = -1;
  for (int step = 0; step < kMaxTriangleSteps && triangle >= 0; ++step) {
    DeviceShellTriangle here = shell_triangle_at(g, piece.first_triangle + triangle);
    Barycentric found = barycentric_in(here, wanted_mm);
    if (!found.exists) {
      return top;
    }
    vec3 w = found.weights;
    float lowest = min(min(w.x, w.y), w.z);
    int across = here.across_2;
    if (w.x == lowest) {
      across = here.across_0;
    } else if (w.y == lowest) {
      across = here.across_1;
    }
    // A point on an edge would be sent to and fro by rounding.
    bool on_edge = lowest > -edge_width && (across < 0 || across == before);
    if (lowest >= 0.0f || on_edge) {
      top.exists = true;
      top.world_mm =
          piece.centre_mm + w.x * here.top_0_mm + w.y * here.top_1_mm + w.z * here.top_2_mm;
      return top;
    }
    before = triangle;
    triangle = across;
  }
  return top;
}

// The point of the upper surface that lies above a hit at `flat_mm` of the flat fabric, in
// tetrahedron `place` of a shell, moved there by `offset_mm`; none where that is beyond the border.
SHARED TopPoint top_point(Geometry g, int cloth, int place, vec3 flat_mm, vec2 offset_mm) {
  DeviceCloth piece = cloth_at(g, cloth);
  vec2 wanted = vec2(flat_mm.x + offset_mm.x, flat_mm.y + offset_mm.y);
  if (piece.kind == kClothShell) {
    return top_point_of_shell(g, piece, place, wanted);
  }
  TopPoint top;
  top.exists = wanted.x >= piece.low_mm.x && wanted.x <= piece.high_mm.x &&
               wanted.y >= piece.low_mm.y && wanted.y <= piece.high_mm.y;
  // A row vector times the turn: the way back.
  top.world_mm = vec3(wanted.x, wanted.y, piece.high_mm.z) * piece.to_flat + piece.centre_mm;
  return top;
}

// Carries directions from the world to the flat fabric at a hit (FibreHit::to_flat).
SHARED mat3 rotation_at(Geometry g, int cloth, int place) {
  DeviceCloth piece = cloth_at(g, cloth);
  if (piece.kind == kClothFlat) {
    return piece.to_flat;
  }
  return tetrahedron_at(g, piece.first_tetrahedron + place).rotation;
}

SHARED_END

#endif
