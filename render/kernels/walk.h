// Shared text (C++20 and GLSL): a ray's way through one piece of cloth, in stretches that one
// affine map each carries into the flat fabric: the whole box of a flat piece, one tetrahedron of a
// shell after the other. Does on the device what closest() of render/cloth.h does. The including
// program defines what solid.h and grid_march.h ask for, and fabric_at.
#ifndef WEFT_RENDER_KERNELS_WALK_H
#define WEFT_RENDER_KERNELS_WALK_H

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
  int segment;
  vec3 flat_mm;
};

struct WalkResult {
  Walk walk;
  WalkHit hit;
  int steps;
};

// A stretch, seen in the flat fabric.
struct FlatStretch {
  FlatLine line;
  vec2 tile_mm;  // the corner of the tile that the line starts in
  float speed;   // millimetres in the flat fabric for one in the world
};

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
  result.hit.segment = -1;
  result.hit.flat_mm = vec3(0.0f, 0.0f, 0.0f);
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

SHARED FlatStretch flat_stretch(Geometry g, DeviceCloth piece, vec2 size_mm, LocalRay ray,
                                Walk walk, float end_mm) {
  FlatStretch stretch;
  vec3 at = point_at(ray, walk.start_mm);
  vec3 way = ray.direction;
  stretch.tile_mm = vec2(0.0f, 0.0f);
  if (piece.kind == kClothShell) {
    DeviceTetrahedron here = tetrahedron_at(g, piece.first_tetrahedron + walk.place);
    at = here.to_flat * (at - here.corner_mm) + here.flat_mm;
    way = here.to_flat * way;
    stretch.tile_mm = vec2(here.flat_tile_x, here.flat_tile_y) * size_mm;
  }
  vec2 tile = floor(vec2(at.x, at.y) / size_mm) * size_mm;
  stretch.tile_mm = stretch.tile_mm + tile;
  stretch.speed = length(way);
  stretch.line.start_mm = vec3(at.x - tile.x, at.y - tile.y, at.z);
  stretch.line.direction = way / stretch.speed;
  stretch.line.length_mm = (end_mm - walk.start_mm) * stretch.speed;
  return stretch;
}

// The fibre that a walk meets in its stretch. With samples > 0 the paper's way: so many points,
// spaced evenly, in the volume of nearest segments.
SHARED WalkResult search_stretch(Geometry g, DeviceCloth piece, LocalRay ray, Walk walk,
                                 float end_mm, ivec2 samples_and_steps) {
  WalkResult result;
  result.walk = walk;
  result.hit.segment = -1;
  result.hit.flat_mm = vec3(0.0f, 0.0f, 0.0f);
  DeviceFabric fabric = fabric_at(g, piece.fabric);
  FlatStretch stretch = flat_stretch(g, piece, fabric.size_mm, ray, walk, end_mm);
  FlatMeeting meeting;
  if (samples_and_steps.x > 0) {
    meeting = sample_nearest(g, fabric, stretch.line, samples_and_steps.x);
    result.hit.segment = meeting.capsule;
  } else {
    meeting = march_grid(g, fabric, stretch.line, samples_and_steps.y);
    if (meeting.capsule >= 0) {
      result.hit.segment = segment_at(g, meeting.capsule);
    }
  }
  result.steps = meeting.steps;
  if (!meeting.finished) {
    result.walk.state = kWalkHalted;
    result.walk.start_mm = walk.start_mm + meeting.reached_mm / stretch.speed;
  } else if (meeting.capsule >= 0) {
    result.walk.state = kWalkHit;
    result.walk.t_mm = walk.start_mm + meeting.distance_mm / stretch.speed;
    vec3 in_tile = stretch.line.start_mm + meeting.distance_mm * stretch.line.direction;
    result.hit.flat_mm =
        vec3(in_tile.x + stretch.tile_mm.x, in_tile.y + stretch.tile_mm.y, in_tile.z);
  }
  return result;
}

// Goes on with a walk through one piece until something is met before t_max_mm, the piece is left
// behind, or about samples_and_steps.y steps are done: is_done() tells. `ray` is the piece's local
// ray, of a flat piece turned into the flat fabric (ray_of_piece).
SHARED WalkResult walk_on(Geometry g, int cloth, LocalRay ray, Walk walk, float t_max_mm,
                          ivec2 samples_and_steps) {
  DeviceCloth piece = cloth_at(g, cloth);
  WalkResult result;
  result.walk = walk;
  result.hit.segment = -1;
  result.hit.flat_mm = vec3(0.0f, 0.0f, 0.0f);
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
      ivec2 left = ivec2(samples_and_steps.x, samples_and_steps.y - steps);
      result = search_stretch(g, piece, ray, result.walk, end, left);
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
