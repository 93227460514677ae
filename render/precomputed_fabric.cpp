#include "render/precomputed_fabric.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/error.h"
#include "shading/bcsdf_sh.h"

namespace weft::render {
namespace {

using storage::FabricDatabase;

static_assert(shading::kCsAngles == shading::kBcsdfShAngles);

void require(bool holds, const char* what) {
  if (!holds) {
    throw core::Error(core::Code::kDataLoss,
                      std::string("the fabric database contradicts itself: ") + what +
                          "; fetch or make it again");
  }
}

std::size_t sh_count(const FabricDatabase& db) {
  return (std::size_t{db.sh_order} + 1) * (std::size_t{db.sh_order} + 1);
}

void check_sizes(const FabricDatabase& db) {
  const std::size_t segments = db.cell_of_segment.size();
  const std::size_t cells = db.cell_paths.size();
  const std::size_t pixels = std::size_t{db.visibility_resolution} * db.visibility_resolution;
  require(db.sh_order <= static_cast<std::uint32_t>(shading::kShMaxOrder), "its order exceeds 5");
  require(db.transfer.size() == cells * 3 * sh_count(db) * sh_count(db),
          "transfer matrices are missing");
  require(db.c_s.size() == db.materials.size() * 3 * shading::kBcsdfShAngles * sh_count(db),
          "harmonics of a material are missing");
  require(std::all_of(db.cell_of_segment.begin(), db.cell_of_segment.end(),
                      [&](std::uint32_t cell) { return cell < cells; }),
          "a segment lies in no cell");
  require(db.visibility_resolution % 2 == 0 && pixels > 0, "its visibility resolution is odd");
  require(db.ssdf_mean.size() == pixels && db.ssdf_basis.size() == pixels * db.pca_components,
          "the visibility basis is incomplete");
  require(db.ssdf.size() == segments * db.pca_components, "signed distances are missing");
  require(db.ssg.size() == segments * db.sg_count && db.ssg_rotation.size() == segments,
          "visibility weights are missing");
  require(db.open_share.size() == segments, "open shares are missing");
  require(db.sg_sharpness > 0, "the sharpness of its visibility is not positive");
}

std::vector<std::uint32_t> materials_of_segments(const FabricDatabase& db) {
  std::vector<std::uint32_t> materials;
  materials.reserve(db.cell_of_segment.size());
  for (std::size_t s = 0; s + 2 < db.strands.size(); s += 3) {
    require(db.strands[s] >= 2, "a strand has no segment");
    require(db.strands[s + 1] < db.materials.size(), "a material is missing");
    materials.insert(materials.end(), db.strands[s] - 1, db.strands[s + 1]);
    require(materials.size() <= db.cell_of_segment.size(), "its strands have too many segments");
  }
  require(materials.size() == db.cell_of_segment.size(), "its strands have too few segments");
  return materials;
}

}  // namespace

PrecomputedFabric::PrecomputedFabric(FabricDatabase database, const PrecomputedSettings& settings)
    : db_(std::move(database)), settings_(settings) {
  check_sizes(db_);
  material_of_segment_ = materials_of_segments(db_);
  bcsdfs_.reserve(db_.materials.size());
  for (const shading::FibreMaterial& material : db_.materials) {
    bcsdfs_.emplace_back(material);
  }
  take_basis();
  for (std::uint32_t q = 0; q < db_.sg_count; ++q) {
    sg_axes_.push_back(
        shading::fibonacci_axis(static_cast<int>(q), static_cast<int>(db_.sg_count), 0));
  }
}

// One pixel is decoded at a time: its mean and all its components side by side.
void PrecomputedFabric::take_basis() {
  const std::size_t pixels = db_.ssdf_mean.size();
  const std::size_t stride = std::size_t{db_.pca_components} + 1;
  basis_.resize(pixels * stride);
  for (std::size_t p = 0; p < pixels; ++p) {
    basis_[p * stride] = db_.ssdf_mean[p];
    for (std::size_t k = 0; k < db_.pca_components; ++k) {
      basis_[p * stride + 1 + k] = db_.ssdf_basis[k * pixels + p];
    }
  }
  db_.ssdf_basis = {};
  db_.ssdf_mean = {};
}

const shading::FibreBcsdf& PrecomputedFabric::bcsdf_of_segment(std::uint32_t segment) const {
  return bcsdfs_[material_of_segment_[segment]];
}

ShadingPoint PrecomputedFabric::point(std::uint32_t segment, glm::vec3 tangent,
                                      glm::vec3 omega_o) const {
  ShadingPoint at{shading::seen_fibre(tangent, omega_o), segment, &bcsdf_of_segment(segment), {}};
  // C_S by linear interpolation in theta_o, then from omega_o-space to the flat fabric.
  const shading::FabricTables all = tables();
  const shading::CsPlace place = shading::c_s_place(shading::fibre_angle(at.omega_o).theta);
  const shading::ShRotation to_flat = shading::sh_rotation_to_flat(at);
  const auto material = static_cast<int>(material_of_segment_[segment]);
  for (int channel = 0; channel < 3; ++channel) {
    at.c_s[static_cast<std::size_t>(channel)] =
        shading::sh_rotate(to_flat, shading::c_s_at(all, material, channel, place));
  }
  return at;
}

shading::FabricTables PrecomputedFabric::tables() const {
  shading::FabricTables t;
  t.sizes.resolution = static_cast<int>(db_.visibility_resolution);
  t.sizes.ssdf_pairs = static_cast<int>(db_.pca_components / 2 + 1);
  t.sizes.gaussians = static_cast<int>(db_.sg_count);
  t.sizes.sharpness = db_.sg_sharpness;
  t.sizes.harmonics = static_cast<int>(sh_count(db_));
  t.components = db_.pca_components;
  t.basis = basis_.data();
  t.ssdf = db_.ssdf.data();
  t.gaussians = db_.ssg.data();
  t.rotations = db_.ssg_rotation.data();
  t.open_shares = db_.open_share.data();
  t.axes = sg_axes_.data();
  t.c_s = db_.c_s.data();
  t.transfer = db_.transfer.data();
  return t;
}

float PrecomputedFabric::signed_distance(std::uint32_t segment, glm::vec3 omega) const {
  return shading::signed_distance(tables(), static_cast<int>(segment), omega);
}

bool PrecomputedFabric::sees(std::uint32_t segment, glm::vec3 omega) const {
  return shading::segment_sees(tables(), static_cast<int>(segment), omega);
}

}  // namespace weft::render
