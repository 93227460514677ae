#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/half.h"
#include "shading/scattering_orders.h"
#include "storage/database_fields.h"

namespace weft::storage {

namespace {

[[noreturn]] void refuse(const char* path, const std::string& what) {
  throw core::Error(core::Code::kDataLoss, std::string("dataset ") + path + " is wrong: " + what +
                                               "; fetch or make the file again");
}

void require(bool holds, const char* path, const char* what) {
  if (!holds) {
    refuse(path, what);
  }
}

template <class Range>
void require_finite(const char* path, const Range& values) {
  // Every one is looked at: without a way out the loop becomes vector instructions.
  unsigned wrong = 0;
  for (const float value : values) {
    wrong |= std::isfinite(value) ? 0U : 1U;
  }
  require(wrong == 0, path, "a number is not finite");
}

void require_finite_halves(const char* path, const std::vector<std::uint16_t>& halves) {
  constexpr std::uint16_t kExponent = 0x7c00;
  unsigned wrong = 0;
  for (const std::uint16_t half : halves) {
    wrong |= (half & kExponent) == kExponent ? 1U : 0U;
  }
  require(wrong == 0, path, "a number is not finite");
}

// Names are shown to people: nothing in them may steer a terminal.
void require_plain(const char* path, const std::vector<std::string>& texts) {
  for (const std::string& text : texts) {
    require(std::none_of(text.begin(), text.end(),
                         [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }),
            path, "a text has control characters");
  }
}

bool positive(float value) { return std::isfinite(value) && value > 0; }

bool in_unit_interval(const glm::vec3& colour) {
  return std::min({colour.x, colour.y, colour.z}) >= 0 &&
         std::max({colour.x, colour.y, colour.z}) <= 1;  // false when not a number
}

void check_exemplar(const FabricDatabase& db) {
  require_plain("/exemplar/material_names", db.material_names);
  require_plain("/exemplar/yarn_names", db.yarn_names);
  require_plain("/provenance/software", {db.software});
  require(positive(db.size_mm.x) && positive(db.size_mm.y), "/exemplar/size_mm",
          "it is not positive and finite");
  require(std::isfinite(db.z_bounds_mm.x) && std::isfinite(db.z_bounds_mm.y) &&
              db.z_bounds_mm.x < db.z_bounds_mm.y,
          "/exemplar/z_bounds_mm", "the bounds do not rise");
  require(db.blocks.x > 0 && db.blocks.y > 0, "/exemplar/blocks", "there is no block");
  constexpr std::uint32_t kLastRole = 3;
  for (std::size_t i = 0; i < db.threads.size(); i += 3) {
    require(db.threads[i] < db.yarn_names.size(), "/exemplar/threads", "a yarn is missing");
    require(db.threads[i + 1] <= kLastRole, "/exemplar/threads", "a role is unknown");
  }
  const std::size_t threads = db.threads.size() / 3;
  std::uint64_t points = 0;
  for (std::size_t i = 0; i < db.strands.size(); i += 3) {
    require(db.strands[i] >= 2, "/exemplar/strands", "a strand has less than two points");
    require(db.strands[i + 1] < db.materials.size(), "/exemplar/strands", "a material is missing");
    require(db.strands[i + 2] < threads, "/exemplar/strands", "a thread is missing");
    points += db.strands[i];
  }
  require(points * 3 == db.points_mm.size(), "/exemplar/strands",
          "the strands do not add up to the points");
  require(points - db.strands.size() / 3 == db.cell_of_segment.size(), "/cells/cell_of_segment",
          "it does not have one entry per segment");
  require(std::all_of(db.strand_radius_mm.begin(), db.strand_radius_mm.end(), positive),
          "/exemplar/strand_radius_mm", "a radius is not positive and finite");
  require_finite("/exemplar/points_mm", db.points_mm);
}

void check_materials(const FabricDatabase& db) {
  for (const shading::FibreMaterial& material : db.materials) {
    require(in_unit_interval(material.c_r), "/materials/c_r", "a colour is not in 0 to 1");
    require(in_unit_interval(material.c_tt), "/materials/c_tt", "a colour is not in 0 to 1");
    require(positive(material.beta_r), "/materials/beta_r", "a width is not positive");
    require(positive(material.beta_tt), "/materials/beta_tt", "a width is not positive");
    require(positive(material.gamma_tt), "/materials/gamma_tt", "a width is not positive");
  }
  require_finite("/materials/c_s", db.c_s);
}

void check_cells(const FabricDatabase& db) {
  require(positive(db.mean_free_path_mm), "/cells/mean_free_path_mm", "it is not positive");
  require(positive(db.sigma_shadow_mm), "/cells/sigma_shadow_mm", "it is not positive");
  const std::size_t cells = db.cell_paths.size();
  for (const std::uint32_t cell : db.cell_of_segment) {
    require(cell < cells, "/cells/cell_of_segment", "a cell is missing");
  }
  for (std::size_t i = 0; i < db.cell_coordinates.size(); ++i) {
    const std::uint32_t extent = db.cells_per_axis[static_cast<glm::length_t>(i % 3)];
    require(db.cell_coordinates[i] < extent, "/cells/coordinates", "a cell lies outside the grid");
  }
  require_finite("/iirtf/transfer", db.transfer);
  require_finite("/iirtf/standard_error", db.transfer_se);
  require(std::none_of(db.transfer_se.begin(), db.transfer_se.end(), [](float e) { return e < 0; }),
          "/iirtf/standard_error", "an error is negative");
}

// Sizes are checked, because the extents that occur nowhere else bind whatever they find.
void check_orders(const FabricDatabase& db, const Recolouring& orders) {
  if (orders.order_light.empty() && orders.order_counts.empty() && orders.order_shapes.empty()) {
    return;
  }
  constexpr const char* kLight = "/iirtf/order_light";
  constexpr const char* kCounts = "/iirtf/order_counts";
  constexpr const char* kShapes = "/iirtf/order_shapes";
  const std::size_t materials = db.materials.size();
  const std::size_t low = shading::shape_coefficients(db.sh_order);
  const std::size_t rows =
      db.cell_paths.size() * shading::order_groups(materials) * shading::kOrderBins * 3;
  require(orders.order_light.size() == rows, kLight, "it does not fit cells and materials");
  require(orders.order_counts.size() == rows * shading::order_counts(materials), kCounts,
          "it does not fit cells and materials");
  require(orders.order_shapes.size() == db.cell_paths.size() * shading::kOrderShapes * low * low,
          kShapes, "it does not fit cells and harmonics");
  const auto is_negative = [](std::uint16_t half) { return core::float_from_half(half) < 0; };
  require_finite_halves(kLight, orders.order_light);
  require_finite_halves(kCounts, orders.order_counts);
  require_finite_halves(kShapes, orders.order_shapes);
  require(std::none_of(orders.order_light.begin(), orders.order_light.end(), is_negative), kLight,
          "light is negative");
  require(std::none_of(orders.order_counts.begin(), orders.order_counts.end(), is_negative),
          kCounts, "a count is negative");
}

void check_visibility(const FabricDatabase& db) {
  require_finite("/visibility/ssdf/mean", db.ssdf_mean);
  require_finite("/visibility/ssdf/basis", db.ssdf_basis);
  require_finite_halves("/visibility/ssdf/coefficients", db.ssdf);
  require_finite_halves("/visibility/ssg/weights", db.ssg);
  require(positive(db.sg_sharpness), "/visibility/ssg/sharpness", "it is not positive");
  for (const std::uint16_t half : db.open_share) {
    const float share = core::float_from_half(half);
    require(share >= 0 && share <= 1, "/visibility/open_share", "a share is not in 0 to 1");
  }
  require(db.ssdf_sign_error >= 0 && db.ssdf_sign_error <= 1, "/visibility/ssdf/sign_error",
          "it is not in 0 to 1");
}

}  // namespace

void check_values(const FabricDatabase& database) {
  check_exemplar(database);
  check_materials(database);
  check_cells(database);
  check_visibility(database);
}

void check_recolouring(const FabricDatabase& database, const Recolouring& recolouring) {
  check_orders(database, recolouring);
}

}  // namespace weft::storage
