// Shared text (C++20 and GLSL): pieces of cloth as buffers hold them. Scalar block layout;
// render/gpu/geometry.cpp fills them and asserts their sizes.
//
// Positions of a piece are relative to its `centre_mm`, so that single precision is spent on the
// cloth's own size and not on where it lies.
#ifndef WEFT_RENDER_KERNELS_CLOTH_RECORDS_H
#define WEFT_RENDER_KERNELS_CLOTH_RECORDS_H

#include "shading/dialect.h"

SHARED_BEGIN

const int kClothFlat = 0;
const int kClothShell = 1;

// What lies behind a face of a tetrahedron when it is no other tetrahedron (render::Outside).
const int kBehindTop = -1;
const int kBehindBottom = -2;
const int kBehindBorder = -3;

struct DeviceCloth {
  int kind;
  int black_underlay;  // 0 or 1
  int fabric;          // index of its DeviceFabric; of a patterned piece, of the first one
  // By which the flat fabric is divided: its tile, or the blocks of a pattern (BlockPattern of
  // render/cloth_fabric.h).
  vec2 unit_mm;
  int pattern_width;  // in blocks; 0: all is of one fabric
  int pattern_height;
  int first_pattern;  // of the indices of fabrics, row by row
  vec3 centre_mm;     // of the piece, in the world
  mat3 to_flat;       // flat: carries directions of the world into the flat fabric
  vec3 low_mm;        // flat: the box of the cloth in the flat fabric, without its turn
  vec3 high_mm;
  float contact_mm;  // meetings nearer than this with the cloth's own surface are rounding
  float step_mm;     // by which a ray goes on beyond a face or a border
  int first_tetrahedron;
  int first_triangle;
  int first_node;
  int first_face;
};

// A piece of the map between the world and the flat fabric that is affine.
struct DeviceTetrahedron {
  vec3 corner_mm;     // one of its corners, in the world, relative to the piece's centre
  mat3 to_flat;       // flat = to_flat (world - corner) + flat
  vec3 flat_mm;       // of that corner, in its unit of the flat fabric
  float flat_unit_x;  // the unit, whole numbers
  float flat_unit_y;
  // Face i is opposite to corner i: its unit normal points out, its plane is normal . (world -
  // corner) = offset.
  vec3 normal_0;
  vec3 normal_1;
  vec3 normal_2;
  vec3 normal_3;
  vec4 offsets_mm;
  int behind_0;  // the tetrahedron behind face 0, counted from the piece's first, or kBehind...
  int behind_1;
  int behind_2;
  int behind_3;
  mat3 rotation;  // orthogonal polar factor of to_flat
  int bare;       // 1: it holds no fibre
};

// A prism of the shell, seen in the flat fabric.
struct DeviceShellTriangle {
  vec2 flat_0_mm;
  vec2 flat_1_mm;
  vec2 flat_2_mm;
  vec3 top_0_mm;  // in the world, relative to the piece's centre
  vec3 top_1_mm;
  vec3 top_2_mm;
  int across_0;  // the triangle beyond the edge opposite to corner 0, counted from the piece's
  int across_1;  // first; -1: nothing
  int across_2;
};

// A box of the hierarchy over a shell's outside.
struct DeviceNode {
  vec3 low_mm;
  int first;  // inner node: of its two children, counted from the piece's first; leaf: first face
  vec3 high_mm;
  int count;  // faces of a leaf; -1, -2, -3: an inner node, whose first child lies lower along x,
              // y, z
};

// A triangle of a shell's outside.
struct DeviceOuterFace {
  vec3 a_mm;  // relative to the piece's centre
  vec3 b_mm;
  vec3 c_mm;
  int tetrahedron;  // counted from the piece's first
  int face;
};

SHARED_END

#endif
