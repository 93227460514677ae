// Shared text (C++20 and GLSL): a ray's way through one piece of cloth, in stretches that one
// affine map each carries into the flat fabric: the whole box of a flat piece, one tetrahedron of a
// shell after the other. Does on the device what closest() of render/cloth.h does. The including
// program defines what solid.h, grid_march.h and nearest_voxel.h ask for, fabric_at, segment_at and
// pattern_at.
#ifndef WEFT_RENDER_KERNELS_WALK_H
#define WEFT_RENDER_KERNELS_WALK_H

#include "render/kernels/flat_place.h"
#include "render/kernels/grid_march.h"
#include "render/kernels/nearest_voxel.h"
#include "render/kernels/solid.h"

SHARED_BEGIN

const int kWalkAhead = -1;   // not begun: walk_begin()
const int kWalkOutside = 0;  // before the piece, or between two stays in it
const int kWalkInside = 1;   // at the end of a stretch
const int kWalkHalted = 2;   // within a stretch
const int kWalkHit = 3;
const int kWalkAbsorbed = 4;
const int kWalkOver = 5;  // nothing more will be met

// Distances are along the piece's local ray.
struct Walk {
  int state;
  int place;       // tetrahedron of the stretch; -1 on a flat piece
  int entered_by;  // face of the tetrahedron; -1: the ray starts in it
  int behind;      // what lies behind the stretch: a tetrahedron or kBehind...
  float t_mm;      // outside: nothing is left before; hit and absorbed: where
  float start_mm;  // of the stretch that is left
  float end_mm;
};

// What of the fabric a walk has met, where its state is kWalkHit.
struct WalkHit {
  int fabric;
  int segment;
  vec3 flat_mm;
};

struct WalkResult {
  Walk walk;
  WalkHit hit;
  int steps;
};

// A stretch, or what is left of it, seen in the flat fabric.
struct FlatStretch {
  vec3 start_mm;  // from the corner of `unit`
  vec2 unit;
  vec3 direction;  // unit length
  float length_mm;
  float speed;  // millimetres in the flat fabric for one in the world
};

SHARED WalkHit no_hit() {
  WalkHit hit;
  hit.fabric = -1;
  hit.segment = -1;
  hit.flat_mm = vec3(0.0f, 0.0f, 0.0f);
  return hit;
}

SHARED Walk walk_begin(LocalRay ray) {
  Walk walk;
  walk.state = kWalkOutside;
  walk.place = -1;
  walk.entered_by = -1;
  walk.behind = kBehindBorder;
  walk.t_mm = -ray.moved_mm;
  walk.start_mm = 0.0f;
  walk.end_mm = 0.0f;
  return walk;
}

SHARED bool is_done(Walk walk) { return walk.state >= kWalkHit; }

SHARED Walk walk_over(Walk walk) {
  walk.state = kWalkOver;
  return walk;
}

SHARED Walk absorbed_at(Walk walk, float t_mm) {
  walk.state = kWalkAbsorbed;
  walk.t_mm = t_mm;
  return walk;
}

// The next stretch of a flat piece: there is but one.
SHARED Walk advance_in_swatch(DeviceCloth piece, LocalRay ray, Walk walk, float t_max_mm) {
  bool sheet = piece.black_underlay != 0;
  if (walk.state == kWalkInside) {
    bool below = walk.behind == kBehindBottom && walk.end_mm < t_max_mm;
    return sheet && below ? absorbed_at(walk, walk.end_mm) : walk_over(walk);
  }
  FlatPassage passage = flat_passage(piece, ray, 0.0f);
  // In endless cloth a level ray never leaves.
  float leave = min(passage.leave_mm, 1e6f);
  if (!(passage.enter_mm < leave) || leave <= walk.t_mm || passage.enter_mm >= t_max_mm) {
    return walk_over(walk);
  }
  bool by_surface = passage.enter_axis == 2;
  if (sheet && by_surface && passage.enter_mm > walk.t_mm && ray.direction.z > 0.0f) {
    return absorbed_at(walk, passage.enter_mm);
  }
  // The highest fibres touch the surface: a ray that began on it might begin inside them.
  float slack = by_surface ? 0.01f * (piece.high_mm.z - piece.low_mm.z) : 0.0f;
  walk.state = kWalkInside;
  walk.start_mm = max(walk.t_mm, passage.enter_mm - slack);
  walk.end_mm = leave;
  bool to_below = passage.leave_axis == 2 && ray.direction.z < 0.0f;
  walk.behind = to_below ? kBehindBottom : kBehindBorder;
  return walk;
}

SHARED int behind_of(DeviceTetrahedron tetrahedron, int face) {
  int low = face == 0 ? tetrahedron.behind_0 : tetrahedron.behind_1;
  int high = face == 2 ? tetrahedron.behind_2 : tetrahedron.behind_3;
  return face < 2 ? low : high;
}

SHARED vec3 normal_of(DeviceTetrahedron tetrahedron, int face) {
  vec3 low = face == 0 ? tetrahedron.normal_0 : tetrahedron.normal_1;
  vec3 high = face == 2 ? tetrahedron.normal_2 : tetrahedron.normal_3;
  return face < 2 ? low : high;
}

SHARED int face_towards(DeviceTetrahedron tetrahedron, int neighbour) {
  for (int face = 0; face < 4; ++face) {
    if (behind_of(tetrahedron, face) == neighbour) {
      return face;
    }
  }
  return -1;
}

// Where a ray that is in a tetrahedron at t_mm leaves it.
SHARED Walk through_tetrahedron(DeviceTetrahedron tetrahedron, LocalRay ray, Walk walk,
                                float t_mm) {
  vec3 at = point_at(ray, t_mm) - tetrahedron.corner_mm;
  float nearest = kFarMm;
  walk.behind = kBehindBorder;
  for (int face = 0; face < 4; ++face) {
    vec3 normal = normal_of(tetrahedron, face);
    float speed = dot(normal, ray.direction);
    float reach = (tetrahedron.offsets_mm[face] - dot(normal, at)) / speed;
    if (face != walk.entered_by && speed > 0.0f && reach < nearest) {
      nearest = reach;
      walk.behind = behind_of(tetrahedron, face);
    }
  }
  walk.state = kWalkInside;
  walk.end_mm = nearest < kFarMm ? t_mm + max(nearest, 0.0f) : t_mm;
  return walk;
}

// The next stretch of a shell, or none yet: then the state is kWalkOutside.
SHARED WalkResult advance_in_shell(Geometry g, int cloth, LocalRay ray, Walk walk, float t_max_mm) {
  WalkResult result;
  result.hit = no_hit();
  result.steps = 1;
  result.walk = walk;
  DeviceCloth piece = cloth_at(g, cloth);
  bool sheet = piece.black_underlay != 0;
  float t = walk.end_mm;
  if (walk.state == kWalkInside) {
    if (walk.behind < 0 || walk.end_mm >= t_max_mm) {
      bool below = walk.behind == kBehindBottom && walk.end_mm < t_max_mm;
      result.walk.state = kWalkOutside;
      result.walk.t_mm = max(walk.t_mm, walk.end_mm + piece.step_mm);
      if (sheet && below) {
        result.walk = absorbed_at(walk, walk.end_mm);
      }
      return result;
    }
    int left = walk.place;
    result.walk.place = walk.behind;
    result.walk.entered_by =
        face_towards(tetrahedron_at(g, piece.first_tetrahedron + walk.behind), left);
    result.walk.start_mm = t;
  } else {
    OuterHit met = outer_face_between(g, cloth, ray, vec2(walk.t_mm, t_max_mm), false);
    result.steps += met.steps;
    if (met.face < 0) {
      result.walk = walk_over(walk);
      return result;
    }
    DeviceOuterFace face = outer_face_at(g, piece.first_face + met.face);
    DeviceTetrahedron entered = tetrahedron_at(g, piece.first_tetrahedron + face.tetrahedron);
    t = met.t_mm;
    result.walk.t_mm = t + piece.step_mm;
    if (dot(normal_of(entered, face.face), ray.direction) >= 0.0f) {
      return result;  // the way out, of a stay that is over
    }
    if (sheet && behind_of(entered, face.face) == kBehindBottom) {
      result.walk = absorbed_at(walk, t);
      return result;
    }
    result.walk.place = face.tetrahedron;
    result.walk.entered_by = face.face;
    // The highest fibres touch the surface: a ray that began on it might begin inside them.
    result.walk.start_mm = max(-ray.moved_mm, t - piece.contact_mm);
  }
  result.walk = through_tetrahedron(tetrahedron_at(g, piece.first_tetrahedron + result.walk.place),
                                    ray, result.walk, t);
  return result;
}

SHARED FlatStretch flat_stretch(Geometry g, DeviceCloth piece, LocalRay ray, Walk walk,
                                float end_mm) {
  FlatStretch stretch;
  stretch.start_mm = point_at(ray, walk.start_mm);
  stretch.unit = vec2(0.0f, 0.0f);
  vec3 way = ray.direction;
  if (piece.kind == kClothShell) {
    DeviceTetrahedron here = tetrahedron_at(g, piece.first_tetrahedron + walk.place);
    stretch.start_mm = here.to_flat * (stretch.start_mm - here.corner_mm) + here.flat_mm;
    stretch.unit = vec2(here.flat_unit_x, here.flat_unit_y);
    way = here.to_flat * way;
  }
  stretch.speed = length(way);
  stretch.direction = way / stretch.speed;
  stretch.length_mm = (end_mm - walk.start_mm) * stretch.speed;
  return stretch;
}

SHARED WalkHit hit_at(DeviceCloth piece, FlatPlace place, vec3 onwards_mm, int segment) {
  WalkHit hit;
  hit.fabric = place.fabric;
  hit.segment = segment;
  vec3 in_unit = place.in_unit_mm + onwards_mm;
  hit.flat_mm = vec3(in_unit.x + place.unit.x * piece.unit_mm.x,
                     in_unit.y + place.unit.y * piece.unit_mm.y, in_unit.z);
  return hit;
}

// The paper's way through a stretch: the first of so many points, spaced evenly, whose voxel of the
// volume of nearest segments is not empty.
SHARED WalkResult sample_stretch(Geometry g, DeviceCloth piece, FlatStretch stretch, Walk walk,
                                 int samples) {
  WalkResult result;
  result.walk = walk;
  result.hit = no_hit();
  result.steps = 0;
  float spacing = stretch.length_mm / float(samples);
  while (result.steps < samples && result.hit.segment < 0) {
    float distance_mm = (float(result.steps) + 0.5f) * spacing;
    vec3 at = stretch.start_mm + distance_mm * stretch.direction;
    FlatPlace place = flat_place(g, piece, at, stretch.unit, vec2(0.0f, 0.0f));
    int segment = nearest_segment(g, fabric_at(g, place.fabric), place.in_tile_mm);
    if (segment >= 0) {
      result.hit = hit_at(piece, place, vec3(0.0f, 0.0f, 0.0f), segment);
      result.walk.state = kWalkHit;
      result.walk.t_mm = walk.start_mm + distance_mm / stretch.speed;
    }
    ++result.steps;
  }
  return result;
}

// The fibre that a walk meets in its stretch; of patterned cloth, in the first block of what is
// left of it.
SHARED WalkResult march_stretch(Geometry g, DeviceCloth piece, FlatStretch stretch, Walk walk,
                                int most_steps) {
  WalkResult result;
  result.walk = walk;
  result.hit = no_hit();
  // Far enough that rounding does not hold the ray in the block that it leaves.
  float slack = (piece.step_mm + 2.4e-7f * abs(walk.start_mm)) * stretch.speed;
  vec2 ahead = slack * vec2(stretch.direction.x, stretch.direction.y);
  FlatPlace place = flat_place(g, piece, stretch.start_mm, stretch.unit, ahead);
  FlatLine line;
  line.start_mm = place.in_tile_mm;
  line.direction = stretch.direction;
  line.length_mm = stretch.length_mm;
  bool goes_on = false;
  if (piece.pattern_width > 0) {
    vec2 border = vec2(line.direction.x > 0.0f ? piece.unit_mm.x : 0.0f,
                       line.direction.y > 0.0f ? piece.unit_mm.y : 0.0f);
    float to_x = (border.x - place.in_unit_mm.x) * inverse_of(line.direction.x);
    float to_y = (border.y - place.in_unit_mm.y) * inverse_of(line.direction.y);
    float leave = max(min(to_x, to_y), slack);
    goes_on = leave < line.length_mm;
    line.length_mm = min(line.length_mm, leave);
  }
  FlatMeeting meeting = march_grid(g, fabric_at(g, place.fabric), line, most_steps);
  result.steps = meeting.steps;
  if (!meeting.finished) {
    result.walk.state = kWalkHalted;
    result.walk.start_mm = walk.start_mm + meeting.reached_mm / stretch.speed;
  } else if (meeting.capsule >= 0) {
    result.walk.state = kWalkHit;
    result.walk.t_mm = walk.start_mm + meeting.distance_mm / stretch.speed;
    result.hit =
        hit_at(piece, place, meeting.distance_mm * line.direction, segment_at(g, meeting.capsule));
  } else if (goes_on) {
    result.walk.state = kWalkHalted;
    result.walk.start_mm = walk.start_mm + line.length_mm / stretch.speed;
  }
  return result;
}

// Goes on with a walk through one piece until something is met before t_max_mm, the piece is left
// behind, or about samples_and_steps.y steps are done: is_done() tells. samples_and_steps.x > 0:
// the paper's search, with so many points. `ray` is the piece's local
// ray, of a flat piece turned into the flat fabric (ray_of_piece).
SHARED WalkResult walk_on(Geometry g, int cloth, LocalRay ray, Walk walk, float t_max_mm,
                          ivec2 samples_and_steps) {
  DeviceCloth piece = cloth_at(g, cloth);
  WalkResult result;
  result.walk = walk;
  result.hit = no_hit();
  result.steps = 0;
  while (!is_done(result.walk) && result.steps < samples_and_steps.y) {
    int steps = result.steps + 1;
    bool bare = false;
    if (result.walk.state == kWalkHalted) {
      result.walk.state = kWalkInside;
    } else if (piece.kind == kClothShell) {
      result = advance_in_shell(g, cloth, ray, result.walk, t_max_mm);
      steps += result.steps;
      bare = result.walk.place >= 0 &&
             tetrahedron_at(g, piece.first_tetrahedron + result.walk.place).bare != 0;
    } else {
      result.walk = advance_in_swatch(piece, ray, result.walk, t_max_mm);
    }
    float end = min(result.walk.end_mm, t_max_mm);
    if (result.walk.state == kWalkInside && !bare && end > result.walk.start_mm) {
      FlatStretch stretch = flat_stretch(g, piece, ray, result.walk, end);
      if (samples_and_steps.x > 0) {
        result = sample_stretch(g, piece, stretch, result.walk, samples_and_steps.x);
      } else {
        result = march_stretch(g, piece, stretch, result.walk, samples_and_steps.y - steps);
      }
      steps += result.steps;
    }
    result.steps = steps;
  }
  return result;
}

SHARED LocalRay ray_of_piece(DeviceCloth piece, vec3 origin_mm, vec3 direction) {
  LocalRay ray = local_ray(piece.centre_mm, origin_mm, direction);
  if (piece.kind == kClothFlat) {
    ray = flat_ray_of(piece, origin_mm, direction);
  }
  return ray;
}

SHARED_END

#endif
