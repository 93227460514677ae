// Shared text (C++20 and GLSL): which fabric shows at a point of the flat cloth, and where in that
// fabric's tile the point is. The including program defines the type Geometry, fabric_at and
// pattern_at.
#ifndef WEFT_RENDER_KERNELS_FLAT_PLACE_H
#define WEFT_RENDER_KERNELS_FLAT_PLACE_H

#include "render/kernels/cloth_records.h"
#include "render/kernels/grid_records.h"

SHARED_BEGIN

struct FlatPlace {
  int fabric;
  vec2 unit;  // DeviceCloth::unit_mm, whole numbers
  vec3 in_unit_mm;
  vec3 in_tile_mm;  // of the fabric
};

// Remainders of negative numbers differ between devices: there are none here.
SHARED int repeated(int i, int count) { return i >= 0 ? i % count : count - 1 - (-1 - i) % count; }

// The place of a point that lies at `at_mm` from the corner of `unit`. On the border between units
// it belongs to the one that `ahead_mm` points to.
SHARED FlatPlace flat_place(Geometry g, DeviceCloth piece, vec3 at_mm, vec2 unit, vec2 ahead_mm) {
  FlatPlace place;
  vec2 more = floor((vec2(at_mm.x, at_mm.y) + ahead_mm) / piece.unit_mm);
  place.unit = unit + more;
  place.in_unit_mm =
      vec3(at_mm.x - more.x * piece.unit_mm.x, at_mm.y - more.y * piece.unit_mm.y, at_mm.z);
  place.in_tile_mm = place.in_unit_mm;
  place.fabric = piece.fabric;
  if (piece.pattern_width > 0) {
    ivec2 block = ivec2(place.unit);
    place.fabric = pattern_at(g, piece.first_pattern + repeated(block.x, piece.pattern_width) +
                                     piece.pattern_width * repeated(block.y, piece.pattern_height));
    DeviceFabric fabric = fabric_at(g, place.fabric);
    place.in_tile_mm.x += float(repeated(block.x, fabric.blocks.x)) * piece.unit_mm.x;
    place.in_tile_mm.y += float(repeated(block.y, fabric.blocks.y)) * piece.unit_mm.y;
  }
  return place;
}

SHARED_END

#endif
