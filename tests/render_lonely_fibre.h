#pragma once

#include <vector>

#include "core/half.h"
#include "shading/bcsdf_sh.h"
#include "storage/fabric_database.h"

namespace weft::test {

inline shading::FibreMaterial lonely_material() {
  shading::FibreMaterial result;
  result.c_r = {0.3f, 0.2f, 0.1f};
  result.c_tt = {0.6f, 0.5f, 0.4f};
  result.beta_r = 0.12f;
  result.beta_tt = 0.17f;
  result.gamma_tt = 0.35f;
  return result;
}

// The database of one straight fibre along x in a wide tile: every segment sees everything, and
// `transfer` of constant light arrives as constant light.
inline storage::FabricDatabase lonely_fibre(float transfer) {
  constexpr std::size_t kHarmonics = 36;
  storage::FabricDatabase db;
  db.size_mm = {10, 10};
  db.z_bounds_mm = {-0.05f, 0.05f};
  db.material_names = {"grey"};
  db.yarn_names = {"yarn"};
  db.threads = {0, 3, 0};
  db.strands = {3, 0, 0};
  db.strand_periods = {1, 0};
  db.strand_radius_mm = {0.05f};
  db.points_mm = {0, 5, 0, 5, 5, 0, 10, 5, 0};
  db.materials = {lonely_material()};
  static const std::vector<float> table = shading::bcsdf_sh_table(lonely_material(), 5);
  db.c_s = table;
  db.mean_free_path_mm = 0.1f;
  db.sigma_shadow_mm = 0.5f;
  db.cell_of_segment = {0, 0};
  db.cell_coordinates = {0, 0, 0};
  db.sh_order = 5;
  db.cell_paths = {1};
  db.transfer.assign(3 * kHarmonics * kHarmonics, 0.0f);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    db.transfer[channel * kHarmonics * kHarmonics] = transfer;
  }
  db.transfer_se.assign(db.transfer.size(), 0.0f);
  db.visibility_resolution = 16;
  db.pca_components = 1;
  db.ssdf_mean.assign(256, 3.0f);
  db.ssdf_basis.assign(256, 0.0f);
  db.ssdf.assign(2, 0);
  db.sg_count = 1;
  db.sg_sharpness = 128;
  db.ssg.assign(2, 0);
  db.ssg_rotation.assign(2, 0);
  db.open_share.assign(2, core::half_from_float(1));
  db.description_json = R"({"name":"lonely"})";
  db.stages_json = "{}";
  db.software = "test";
  return db;
}

}  // namespace weft::test
