#pragma once

#include "storage/database_schema.h"
#include "storage/fabric_database.h"
#include "storage/recolouring.h"

namespace weft::storage {

// Which member of FabricDatabase belongs to which dataset, once for writing and for reading: calls
// io for every dataset of the schema, in the schema's order. `Database` is FabricDatabase, const
// when writing.
template <class Io, class Database>
void exchange_fields(Io& io, Database& db) {
  io.values("/exemplar/size_mm", &db.size_mm.x);
  io.values("/exemplar/z_bounds_mm", &db.z_bounds_mm.x);
  io.values("/exemplar/blocks", &db.blocks.x);
  io.texts("/exemplar/material_names", db.material_names);
  io.texts("/exemplar/yarn_names", db.yarn_names);
  io.array("/exemplar/threads", db.threads);
  io.array("/exemplar/strands", db.strands);
  io.array("/exemplar/strand_periods", db.strand_periods);
  io.array("/exemplar/strand_radius_mm", db.strand_radius_mm);
  io.array("/exemplar/points_mm", db.points_mm);

  io.values("/cells/mean_free_path_mm", &db.mean_free_path_mm);
  io.values("/cells/cells_per_axis", &db.cells_per_axis.x);
  io.array("/cells/cell_of_segment", db.cell_of_segment);
  io.array("/cells/coordinates", db.cell_coordinates);

  io.derived("/visibility/theta");
  io.derived("/visibility/phi");
  io.array("/visibility/open_share", db.open_share);
  io.array("/visibility/ssdf/mean", db.ssdf_mean);
  io.array("/visibility/ssdf/basis", db.ssdf_basis);
  io.array("/visibility/ssdf/coefficients", db.ssdf);
  io.values("/visibility/ssdf/sign_error", &db.ssdf_sign_error);
  io.values("/visibility/ssg/sharpness", &db.sg_sharpness);
  io.derived("/visibility/ssg/axes");
  io.array("/visibility/ssg/weights", db.ssg);
  io.array("/visibility/ssg/rotation", db.ssg_rotation);

  io.derived("/sg/sharpness");
  io.derived("/sg/zonal");

  io.columns("/materials/c_r", db.materials, [](auto& m) { return &m.c_r.x; });
  io.columns("/materials/c_tt", db.materials, [](auto& m) { return &m.c_tt.x; });
  io.columns("/materials/beta_r", db.materials, [](auto& m) { return &m.beta_r; });
  io.columns("/materials/beta_tt", db.materials, [](auto& m) { return &m.beta_tt; });
  io.columns("/materials/gamma_tt", db.materials, [](auto& m) { return &m.gamma_tt; });
  io.derived("/materials/theta_o");
  io.array("/materials/c_s", db.c_s);

  io.values("/cells/sigma_shadow_mm", &db.sigma_shadow_mm);
  io.array("/iirtf/paths", db.cell_paths);
  io.rounded("/iirtf/transfer", db.transfer);
  io.rounded("/iirtf/standard_error", db.transfer_se);

  io.text("/provenance/description", db.description_json);
  io.text("/provenance/stages", db.stages_json);
  io.text("/provenance/software", db.software);
}

// The same for the optional datasets, which come last.
template <class Io, class Extra>
void exchange_recolouring(Io& io, Extra& extra) {
  io.optional_array("/iirtf/order_light", extra.order_light);
  io.optional_array("/iirtf/order_counts", extra.order_counts);
  io.optional_array("/iirtf/order_shapes", extra.order_shapes);
  io.optional_text("/provenance/carried_over", extra.carried_over_json);
}

// Throws core::Error(kDataLoss) naming the dataset unless indices are in range, counts agree,
// numbers are finite and quantities have the sign they must have. REQUIRES: the sizes of the arrays
// agree with each other as the schema says.
void check_values(const FabricDatabase& database);

// The same for the optional datasets of a database whose values are right.
void check_recolouring(const FabricDatabase& database, const Recolouring& recolouring);

}  // namespace weft::storage
