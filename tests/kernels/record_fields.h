// The fields of every struct that crosses between host and device, in order; read by C++ and GLSL
// alike (record_copy.comp, render_gpu_records_test.cpp). The including program defines what
// render/kernels/eye_ray.h asks for.
#ifndef WEFT_TESTS_KERNELS_RECORD_FIELDS_H
#define WEFT_TESTS_KERNELS_RECORD_FIELDS_H

#include "render/kernels/cloth_records.h"
#include "render/kernels/eye_ray.h"
#include "render/kernels/hit.h"
#include "render/kernels/shading_records.h"

// clang-format does not settle on one form of these.
// clang-format off

#define FIELDS_OF_HIT(F) \
  F(fate) F(cloth) F(fabric) F(place) F(segment) F(t_mm) F(world_mm) F(flat_mm) F(to_eye)

#define FIELDS_OF_CLOTH(F) \
  F(kind) F(black_underlay) F(fabric) F(unit_mm) F(pattern_width) F(pattern_height) \
  F(first_pattern) F(centre_mm) F(to_flat) F(low_mm) F(high_mm) F(contact_mm) F(step_mm) \
  F(first_tetrahedron) F(first_triangle) F(first_node) F(first_face)

#define FIELDS_OF_TETRAHEDRON(F) \
  F(corner_mm) F(to_flat) F(flat_mm) F(flat_unit_x) F(flat_unit_y) F(normal_0) F(normal_1) \
  F(normal_2) F(normal_3) F(offsets_mm) F(behind_0) F(behind_1) F(behind_2) F(behind_3) \
  F(rotation) F(bare)

#define FIELDS_OF_SHELL_TRIANGLE(F) \
  F(flat_0_mm) F(flat_1_mm) F(flat_2_mm) F(top_0_mm) F(top_1_mm) F(top_2_mm) F(across_0) \
  F(across_1) F(across_2)

#define FIELDS_OF_NODE(F) \
  F(low_mm) F(first) F(high_mm) F(count)

#define FIELDS_OF_OUTER_FACE(F) \
  F(a_mm) F(b_mm) F(c_mm) F(tetrahedron) F(face)

#define FIELDS_OF_FABRIC_SIZES(F) \
  F(resolution) F(ssdf_pairs) F(gaussians) F(sharpness) F(harmonics) F(quads) \
  F(transfer_is_half) F(sigma_shadow_mm) F(first_axis) F(first_material) F(first_lobe) \
  F(first_c_s)

#define FIELDS_OF_SEGMENT(F) \
  F(cell) F(material_and_rotation) F(open_share) F(tangent)

#define FIELDS_OF_LIGHT(F) \
  F(kind) F(cut_at_horizon) F(place) F(edge_a) F(edge_b) F(sharpness) F(colour)

#define FIELDS_OF_SAMPLE(F) \
  F(single) F(multiple) F(arriving) F(through)

#define FIELDS_OF_PIXEL(F) \
  F(single) F(single_rest) F(multiple) F(multiple_rest) F(squared) F(squared_rest) F(shadow) \
  F(shadow_rest) F(on_cloth) F(on_nothing) F(cloth) F(fabric) F(place) F(segment)

#define FIELDS_OF_SHADING_CALL(F) \
  F(batch.seed) F(batch.width) F(batch.band_top) F(batch.left) F(batch.top) F(batch.columns) \
  F(batch.rows) F(batch.first_sample) F(batch.sample_count) F(batch.capacity) F(cloths) \
  F(cloth) F(fabric) F(light) F(is_first) F(wanted) F(transferred) F(first_cell) \
  F(first_of_page) F(cells) F(blend_low) F(blend_high) F(gamma_method)

#define FIELDS_OF_FABRIC(F) \
  F(size_mm) F(blocks) F(z_low_mm) F(z_high_mm) F(voxel_mm) F(bricks) F(first_brick) \
  F(nearest_voxels) F(first_nearest)

#define FIELDS_OF_CAPSULE(F) \
  F(middle_mm) F(radius_mm) F(axis) F(half_length_mm)

#define FIELDS_OF_EYE_TASK(F) \
  F(position_mm) F(perspective) F(forward) F(width) F(across) F(height) F(down) F(cloths) \
  F(seed) F(left) F(top) F(columns) F(rows) F(first_sample) F(sample_count) F(resumes) \
  F(nearest_samples)

#define FIELDS_OF_EYE_SEARCH(F) \
  F(cloth) F(walk.state) F(walk.place) F(walk.entered_by) F(walk.behind) F(walk.t_mm) \
  F(walk.start_mm) F(walk.end_mm)

// clang-format on

#endif
