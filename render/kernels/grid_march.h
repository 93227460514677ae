// Shared text (C++20 and GLSL): a straight line through endless flat fabric, from voxel to voxel of
// its grid, to the first fibre that it enters. The including program defines the type Geometry and
// brick_at (the brick's first voxel, -1: empty), voxel_at (the voxel's first entry; the next
// voxel's ends it), entry_at (a capsule) and capsule_at.
#ifndef WEFT_RENDER_KERNELS_GRID_MARCH_H
#define WEFT_RENDER_KERNELS_GRID_MARCH_H

#include "render/kernels/grid_records.h"
#include "render/kernels/outside.h"

SHARED_BEGIN

// A line in flat fabric: from a point of the tile along a unit direction.
struct FlatLine {
  vec3 start_mm;  // x and y in 0 ... size of the tile
  vec3 direction;
  float length_mm;
};

struct FlatMeeting {
  int capsule;        // that is entered; -1: none
  float distance_mm;  // along the line, to the capsule
  bool finished;      // false: the steps did not suffice
  float reached_mm;   // where it is to go on then
  int steps;          // that were taken
};

// Where a line enters a capsule, along its unit direction; kFarMm when it never does. Negative when
// the line's start lies beyond that point. All differences are taken about the point of the line
// nearest to the capsule's middle, and distances from the axis directly, so that thin fibres far
// away keep their shape (compare Haines et al., "Precision improvements for ray/sphere
// intersection", 2019).
SHARED float capsule_entry(DeviceCapsule capsule, vec3 start_mm, vec3 direction) {
  vec3 from = start_mm - capsule.middle_mm;
  float nearest = -dot(from, direction);
  vec3 o = from + nearest * direction;
  float reach = capsule.radius_mm + capsule.half_length_mm;
  if (dot(o, o) > reach * reach) {
    return kFarMm;
  }
  float squared_radius = capsule.radius_mm * capsule.radius_mm;
  float d_along = dot(direction, capsule.axis);
  float o_along = dot(o, capsule.axis);
  vec3 d_across = direction - d_along * capsule.axis;
  vec3 o_across = o - o_along * capsule.axis;
  float a = dot(d_across, d_across);
  float cap = d_along > 0.0f ? -capsule.half_length_mm : capsule.half_length_mm;
  if (a > 1e-9f) {
    float t_middle = -dot(o_across, d_across) / a;
    vec3 q = o_across + t_middle * d_across;
    float inside = squared_radius - dot(q, q);
    if (inside < 0.0f) {
      return kFarMm;
    }
    float t = t_middle - sqrt(inside / a);
    float along = o_along + t * d_along;
    if (abs(along) <= capsule.half_length_mm) {
      return nearest + t;
    }
    cap = along > 0.0f ? capsule.half_length_mm : -capsule.half_length_mm;
  } else if (dot(o_across, o_across) > squared_radius) {
    return kFarMm;
  }
  vec3 to_cap = o - cap * capsule.axis;
  float behind = dot(to_cap, direction);
  vec3 q = to_cap - behind * direction;
  float inside = squared_radius - dot(q, q);
  return inside < 0.0f ? kFarMm : nearest - behind - sqrt(inside);
}

// How far a march has come. Distances count from `at_mm`, which moves from tile to tile.
struct March {
  vec3 at_mm;  // in the tile
  vec3 direction;
  vec3 inverse;
  vec3 ahead;      // per axis: 1 where the direction is positive, else 0
  ivec3 side;      // per axis: 1 or -1
  float done_mm;   // from the line's start to at_mm
  float limit_mm;  // to the nearest entry found, or to the line's end
  int capsule;     // of that entry; -1: none
  int steps;
  int most_steps;
  float here_mm;  // up to here nothing is left to be found
};

SHARED float least_of(vec3 v) { return min(min(v.x, v.y), v.z); }

// The capsules of one voxel.
SHARED March test_voxel(Geometry g, March march, int voxel) {
  uint first = voxel_at(g, voxel);
  uint last = voxel_at(g, voxel + 1);
  for (uint i = first; i < last; ++i) {
    int capsule = int(entry_at(g, i));
    float t = capsule_entry(capsule_at(g, capsule), march.at_mm, march.direction);
    if (t < march.limit_mm && t >= -march.done_mm) {
      march.limit_mm = t;
      march.capsule = capsule;
    }
  }
  march.steps += int(last - first);
  return march;
}

// From voxel to voxel (Amanatides and Woo 1987) through one brick, which the line enters at
// march.here_mm. Each border is computed anew from whole numbers, so that no error adds up.
SHARED March march_brick(Geometry g, DeviceFabric fabric, March march, vec3 brick_mm, int first) {
  vec3 in_brick = (march.at_mm + march.here_mm * march.direction - brick_mm) / fabric.voxel_mm;
  ivec3 voxel = clamp(ivec3(floor(in_brick)), ivec3(0), ivec3(kBrickEdge - 1));
  vec3 from = brick_mm - march.at_mm;
  bool inside = true;
  while (inside && march.steps < march.most_steps) {
    march = test_voxel(g, march, first + voxel.x + kBrickEdge * (voxel.y + kBrickEdge * voxel.z));
    ++march.steps;
    vec3 to = ((vec3(voxel) + march.ahead) * fabric.voxel_mm + from) * march.inverse;
    float leave = least_of(to);
    march.here_mm = max(march.here_mm, leave);
    if (to.x == leave) {
      voxel.x += march.side.x;
      inside = voxel.x >= 0 && voxel.x < kBrickEdge;
    } else if (to.y == leave) {
      voxel.y += march.side.y;
      inside = voxel.y >= 0 && voxel.y < kBrickEdge;
    } else {
      voxel.z += march.side.z;
      inside = voxel.z >= 0 && voxel.z < kBrickEdge;
    }
    inside = inside && march.here_mm < march.limit_mm;
  }
  return march;
}

// Moves the start of a march to where it has come, in the tile that begins there.
SHARED March carried_on(March march, float t_mm) {
  march.at_mm = march.at_mm + t_mm * march.direction;
  march.done_mm += t_mm;
  march.limit_mm -= t_mm;
  march.here_mm = 0.0f;
  return march;
}

SHARED March march_from(FlatLine line, int most_steps) {
  March march;
  march.at_mm = line.start_mm;
  march.direction = line.direction;
  march.inverse = vec3(inverse_of(line.direction.x), inverse_of(line.direction.y),
                       inverse_of(line.direction.z));
  march.ahead = vec3(march.inverse.x > 0.0f ? 1.0f : 0.0f, march.inverse.y > 0.0f ? 1.0f : 0.0f,
                     march.inverse.z > 0.0f ? 1.0f : 0.0f);
  march.side = ivec3(march.inverse.x > 0.0f ? 1 : -1, march.inverse.y > 0.0f ? 1 : -1,
                     march.inverse.z > 0.0f ? 1 : -1);
  march.done_mm = 0.0f;
  march.limit_mm = line.length_mm;
  march.capsule = -1;
  march.steps = 0;
  march.most_steps = most_steps;
  march.here_mm = 0.0f;
  return march;
}

SHARED float wrapped(float x, float size) { return x - size * floor(x / size); }

// The first fibre that a line enters, in at most about `most_steps` steps from voxel to voxel and
// capsule to capsule. A fibre that holds the line's start is not met.
SHARED FlatMeeting march_grid(Geometry g, DeviceFabric fabric, FlatLine line, int most_steps) {
  March march = march_from(line, most_steps);
  // The part of the line between the grid's lowest and highest plane.
  float to_low = (fabric.z_low_mm - line.start_mm.z) * march.inverse.z;
  float to_high = (fabric.z_high_mm - line.start_mm.z) * march.inverse.z;
  float enter = max(0.0f, min(to_low, to_high));
  march.limit_mm = min(march.limit_mm, max(to_low, to_high));
  bool going = enter < march.limit_mm;
  march = carried_on(march, going ? enter : 0.0f);
  march.at_mm.x = wrapped(march.at_mm.x, fabric.size_mm.x);
  march.at_mm.y = wrapped(march.at_mm.y, fabric.size_mm.y);
  vec3 brick_size = fabric.voxel_mm * float(kBrickEdge);
  vec3 low = vec3(0.0f, 0.0f, fabric.z_low_mm);
  ivec3 brick =
      clamp(ivec3(floor((march.at_mm - low) / brick_size)), ivec3(0), fabric.bricks - ivec3(1));
  while (going && march.steps < march.most_steps) {
    ++march.steps;
    vec3 brick_mm = low + vec3(brick) * brick_size;
    vec3 to = (brick_mm + march.ahead * brick_size - march.at_mm) * march.inverse;
    float leave = least_of(to);
    int first = brick_at(
        g, fabric.first_brick + brick.x + fabric.bricks.x * (brick.y + fabric.bricks.y * brick.z));
    if (first >= 0) {
      march = march_brick(g, fabric, march, brick_mm, first);
    }
    if (march.steps < march.most_steps) {
      march.here_mm = max(march.here_mm, leave);
      going = march.here_mm < march.limit_mm;
      if (to.x == leave) {
        brick.x += march.side.x;
        if (brick.x < 0 || brick.x >= fabric.bricks.x) {
          march = carried_on(march, leave);
          march.at_mm.x = march.side.x > 0 ? 0.0f : fabric.size_mm.x;
          brick.x = march.side.x > 0 ? 0 : fabric.bricks.x - 1;
        }
      } else if (to.y == leave) {
        brick.y += march.side.y;
        if (brick.y < 0 || brick.y >= fabric.bricks.y) {
          march = carried_on(march, leave);
          march.at_mm.y = march.side.y > 0 ? 0.0f : fabric.size_mm.y;
          brick.y = march.side.y > 0 ? 0 : fabric.bricks.y - 1;
        }
      } else {
        brick.z += march.side.z;
        going = going && brick.z >= 0 && brick.z < fabric.bricks.z;
      }
    }
  }
  FlatMeeting meeting;
  meeting.finished = !going || march.here_mm >= march.limit_mm;
  meeting.capsule = meeting.finished ? march.capsule : -1;
  meeting.distance_mm = march.done_mm + march.limit_mm;
  // Goes on a little before, so that no entry is lost to rounding.
  meeting.reached_mm = max(0.0f, march.done_mm + march.here_mm - 0.5f * least_of(fabric.voxel_mm));
  meeting.steps = march.steps;
  return meeting;
}

SHARED_END

#endif
