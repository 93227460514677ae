// Shared text (C++20 and GLSL): what the kernels that shade hits read and write. Scalar block
// layout; render/gpu/fabric_tables.cpp and batch.cpp assert the sizes.
#ifndef WEFT_RENDER_KERNELS_SHADING_RECORDS_H
#define WEFT_RENDER_KERNELS_SHADING_RECORDS_H

#include "shading/dialect.h"

SHARED_BEGIN

// Sizes of a fabric, and where its small tables lie in its array of floats.
struct DeviceFabricSizes {
  int resolution;  // of the visibility maps
  int ssdf_pairs;
  int gaussians;
  float sharpness;
  int harmonics;         // (order + 1)^2
  int quads;             // of rows of a transfer matrix: (harmonics + 3) / 4
  int transfer_is_half;  // 0 or 1
  float sigma_shadow_mm;
  int first_axis;      // [gaussians, 3], before rotation
  int first_material;  // [materials, kMaterialFloats]
  int first_lobe;      // [materials, kLobeTableCells + 1, 2]
  int first_c_s;       // [materials, 3, 512, harmonics]
};

// c_r, c_tt, precision_r, precision_tt, kappa_tt, azimuth_norm.
const int kMaterialFloats = 10;

struct DeviceSegment {
  uint cell;
  uint material_and_rotation;  // material * 65536 + rotation of the Gaussians
  float open_share;
  vec3 tangent;  // unit, in the flat fabric
};

const int kLightDirectional = 0;
const int kLightGaussian = 1;
const int kLightPoint = 2;
const int kLightRectangle = 3;
const int kLightDisc = 4;

struct DeviceLight {
  int kind;
  int cut_at_horizon;  // 0 or 1
  vec3 place;          // direction towards it, unit; position; corner; centre (world, mm)
  vec3 edge_a;         // of a rectangle; normal of a disc
  vec3 edge_b;
  float sharpness;  // radius of a disc, mm
  vec3 colour;      // irradiance, intensity or radiance
};

// What one eye ray has gathered.
struct DeviceSample {
  vec3 single;
  vec3 multiple;
  float arriving;  // light on the upper surface above the hit if no cloth blocked any,
  float through;   // and with the cloth
};

// Sums over the samples of a pixel; each is its first float plus its `rest`, which holds what
// rounding cut off.
struct DevicePixel {
  vec3 single;
  vec3 single_rest;
  vec3 multiple;
  vec3 multiple_rest;
  vec3 squared;  // of the radiance of single and multiple scattering together
  vec3 squared_rest;
  float shadow;
  float shadow_rest;
  uint on_cloth;    // samples that met a fibre
  uint on_nothing;  // ... nothing at all
  // Of the first sample, as its DeviceHit has them; segment -1: it met no fibre.
  int cloth;
  int fabric;
  int place;
  int segment;
};

// The items that a submission works on: some samples of a rectangle of a band of the picture. Item
// i is sample first_sample + i % sample_count of pixel i / sample_count of the rectangle, row by
// row, as in an EyeTask. The sums of the band's pixels lie row by row from its top on.
struct Batch {
  uvec2 seed;  // low word first
  int width;   // of the picture, and of the band
  int band_top;
  int left;  // of the rectangle
  int top;
  int columns;
  int rows;
  int first_sample;
  int sample_count;
  uint capacity;  // of the buffers that hold a value for each item
};

SHARED uint batch_items(Batch batch) {
  return uint(batch.columns) * uint(batch.rows) * uint(batch.sample_count);
}

// What the kernels of one piece of cloth and one light are told.
struct ShadingCall {
  Batch batch;
  int cloths;  // of the scene
  int cloth;
  int fabric;
  int light;
  int is_first;       // 0 or 1: nothing was written for these items yet
  int wanted;         // kWant... added
  int transferred;    // 0 or 1: what arrives is gathered behind the transfer
  int first_cell;     // of the transfer matrices that are bound
  int first_of_page;  // of the cells to work on, counted from first_cell
  int cells;
  float blend_low;
  float blend_high;
  int gamma_method;
};

const int kWantSingle = 1;
const int kWantMultiple = 2;
const int kWantShadow = 4;

SHARED bool wants(ShadingCall call, int what) { return (call.wanted & what) != 0; }

SHARED_END

#endif
