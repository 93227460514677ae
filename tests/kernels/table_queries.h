// Shared text (C++20 and GLSL): a question about one segment of a precomputed fabric and what the
// shared text that reads its tables answers. The including program defines the tables, and
// `FibreLobes lobes_of_segment(int segment)`.
#ifndef WEFT_TESTS_KERNELS_TABLE_QUERIES_H
#define WEFT_TESTS_KERNELS_TABLE_QUERIES_H

#include "render/kernels/light_draws.h"
#include "shading/light_harmonics.h"
#include "shading/multiple_scattering.h"
#include "shading/single_scattering.h"

SHARED_BEGIN

struct TableQuery {
  int segment;
  int cell;
  int material;
  vec3 tangent;
  vec3 to_eye;
  vec3 light;
  float sharpness;
  vec3 point_mm;
  vec2 uniforms;
  DeviceLight drawn;
};

struct TableAnswer {
  float distance;
  int sees;
  vec3 directional;  // nothing of it blocked
  vec3 by_gaussians;
  vec3 blended;
  vec4 c_s;          // entries 1, 3, 11, 35
  vec4 transferred;  // of a directional light
  vec4 turned;       // ..., of a Gaussian, turned into the flat fabric
  vec3 gaussian_draw;
  vec3 draw_direction;
  vec3 draw_weight;
};

SHARED vec4 some_of(ShVector v) { return vec4(v.c[1], v.c[3], v.c[11], v.c[35]); }

SHARED TableAnswer table_answer(FabricTables tables, TableQuery q) {
  TableAnswer r;
  FibreLobes lobes = lobes_of_segment(q.segment);
  SeenFibre seen = seen_fibre(q.tangent, q.to_eye);
  SphericalGaussian light;
  light.axis = q.light;
  light.sharpness = q.sharpness;
  r.distance = signed_distance(tables, q.segment, q.light);
  r.sees = segment_sees(tables, q.segment, q.light) ? 1 : 0;
  r.directional = unoccluded_directional(seen, lobes, q.light);
  r.by_gaussians = single_by_gaussians(tables, q.segment, seen, lobes, light, kGammaHybrid);
  GaussianShading how;
  how.blend_low = 100.0f;
  how.blend_high = 200.0f;
  how.gamma_method = kGammaHybrid;
  r.blended = single_gaussian(tables, q.segment, seen, lobes, light, how);
  CsPlace place = c_s_place(fibre_angle(seen.omega_o).theta);
  r.c_s = some_of(c_s_at(tables, q.material, 1, place));
  r.transferred = some_of(transferred(tables, q.cell, 2, harmonics_of_direction(q.light)));
  r.turned = some_of(sh_rotate(sh_rotation_to_flat(seen), harmonics_of_gaussian(light)));
  r.gaussian_draw = sample_gaussian(q.light, q.sharpness, q.uniforms.x, q.uniforms.y);
  LightDraw draw = draw_light(q.drawn, q.point_mm, q.uniforms.x, q.uniforms.y);
  r.draw_direction = draw.direction;
  r.draw_weight = draw.weight;
  return r;
}

SHARED_END

#endif
