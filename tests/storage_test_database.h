#pragma once

#include <cmath>

#include "core/half.h"
#include "core/random.h"
#include "shading/scattering_orders.h"
#include "storage/fabric_database.h"
#include "storage/recolouring.h"

namespace weft::storage {

// A small database with every section filled: two threads, three strands, seven segments, three
// cells, order 1.
inline FabricDatabase small_database() {
  core::Random random(17, 0);
  const auto floats = [&random](std::size_t count, float scale) {
    std::vector<float> values(count);
    for (float& value : values) {
      value = (2 * random.uniform() - 1) * scale;
    }
    return values;
  };
  const auto halves = [&random](std::size_t count) {
    std::vector<std::uint16_t> values(count);
    for (std::uint16_t& value : values) {
      value = core::half_from_float(random.uniform());
    }
    return values;
  };
  FabricDatabase db;
  db.size_mm = {0.5F, 0.75F};
  db.z_bounds_mm = {-0.1F, 0.2F};
  db.blocks = {1, 2};
  db.material_names = {"silk", "cotton, dyed r\u00f6d"};
  db.yarn_names = {"warp"};
  db.threads = {0, 0, 0, 0, 1, 0};
  db.strands = {3, 0, 0, 4, 1, 1, 3, 1, 1};
  db.strand_periods = {0, 1, 1, 0, 0, 0};
  db.strand_radius_mm = {0.01F, 0.02F, 0.02F};
  db.points_mm = floats(30, 0.4F);
  db.materials = {{{0.1F, 0.2F, 0.3F}, {0.9F, 0.8F, 0.7F}, 0.1F, 0.2F, 0.3F},
                  {{0, 0, 0}, {1, 1, 1}, 0.3F, 0.2F, 0.1F}};
  db.c_s = floats(std::size_t{2} * 3 * 512 * 4, 1.0F);
  db.mean_free_path_mm = 0.05F;
  db.sigma_shadow_mm = 0.1F;
  db.cells_per_axis = {2, 2, 1};
  db.cell_of_segment = {0, 0, 1, 1, 2, 2, 0};
  db.cell_coordinates = {0, 0, 0, 1, 0, 0, 1, 1, 0};
  db.sh_order = 1;
  db.cell_paths = {100, 100, 60};
  db.transfer = floats(std::size_t{3} * 3 * 4 * 4, 0.3F);
  db.transfer_se = floats(std::size_t{3} * 3 * 4 * 4, 0.01F);
  for (float& value : db.transfer) {
    value = core::float_from_half(core::half_from_float(value));
  }
  for (float& value : db.transfer_se) {
    value = core::float_from_half(core::half_from_float(std::fabs(value)));
  }
  db.visibility_resolution = 8;
  db.pca_components = 3;
  db.ssdf_mean = floats(64, 1.0F);
  db.ssdf_basis = floats(192, 1.0F);
  db.ssdf = halves(21);
  db.sg_count = 5;
  db.sg_sharpness = 128;
  db.ssg = halves(35);
  db.ssg_rotation = {0, 1, 2, 3, 4, 5, 65535};
  db.open_share = halves(7);
  db.ssdf_sign_error = 0.0125;
  db.description_json = R"({"name": "small"})";
  db.stages_json = R"({"stages": []})";
  db.software = "weft, schema 1";
  return db;
}

// All optional datasets of the small database.
inline Recolouring small_recolouring() {
  const FabricDatabase db = small_database();
  const std::size_t rows =
      db.cell_paths.size() * shading::order_groups(db.materials.size()) * shading::kOrderBins * 3;
  Recolouring recolouring;
  for (std::size_t i = 0; i < rows; ++i) {
    recolouring.order_light.push_back(core::half_from_float(1 / static_cast<float>(i + 1)));
  }
  recolouring.order_counts.assign(rows * shading::order_counts(db.materials.size()),
                                  core::half_from_float(1.5F));
  const std::size_t low = shading::shape_coefficients(db.sh_order);
  recolouring.order_shapes.assign(db.cell_paths.size() * shading::kOrderShapes * low * low,
                                  core::half_from_float(-0.25F));
  recolouring.carried_over_json = R"({"base": "small@1"})";
  return recolouring;
}

}  // namespace weft::storage
