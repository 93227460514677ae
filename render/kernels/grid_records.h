// Shared text (C++20 and GLSL): the fibres of one tile of fabric in a periodic voxel grid, as
// buffers hold them. Scalar block layout; render/gpu/fabric_grid.cpp builds them.
//
// The grid divides one tile, x and y from 0 to its size, into bricks of kBrickEdge^3 voxels. A
// voxel lists every capsule that reaches into it; a capsule that crosses the tile's border is there
// once for each copy that reaches into the tile.
#ifndef WEFT_RENDER_KERNELS_GRID_RECORDS_H
#define WEFT_RENDER_KERNELS_GRID_RECORDS_H

#include "shading/dialect.h"

SHARED_BEGIN

const int kBrickEdge = 8;
const int kBrickVoxels = 512;

struct DeviceFabric {
  vec2 size_mm;    // of the tile
  ivec2 blocks;    // equal parts of the tile that a pattern may show
  float z_low_mm;  // of the grid
  float z_high_mm;
  vec3 voxel_mm;
  ivec3 bricks;
  int first_brick;
  // The paper's volume, one segment to a voxel; (0, 0, 0) when it was not asked for.
  ivec3 nearest_voxels;
  int first_nearest;
};

// All points within radius_mm of the axis' middle piece, half_length_mm to either side.
struct DeviceCapsule {
  vec3 middle_mm;
  float radius_mm;
  vec3 axis;  // unit
  float half_length_mm;
};

SHARED_END

#endif
