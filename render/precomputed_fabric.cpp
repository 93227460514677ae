#include "render/precomputed_fabric.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/half.h"
#include "shading/bcsdf_sh.h"
#include "shading/sh_rotation.h"
#include "shading/visibility.h"

namespace weft::render {
namespace {

using storage::FabricDatabase;

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
  ShadingPoint at;
  at.segment = segment;
  at.bcsdf = &bcsdf_of_segment(segment);
  at.to_fibre = shading::fibre_frame(tangent, omega_o);
  at.omega_o = at.to_fibre * omega_o;
  // C_S by linear interpolation in theta_o, then from omega_o-space to the flat fabric.
  const float theta_o = shading::fibre_angle(at.omega_o).theta;
  const float t = std::clamp((theta_o + shading::kHalfPi) / shading::kPi, 0.0f, 1.0f) *
                  static_cast<float>(shading::kBcsdfShAngles - 1);
  const std::size_t i =
      std::min(static_cast<std::size_t>(t), static_cast<std::size_t>(shading::kBcsdfShAngles - 2));
  const float f = t - static_cast<float>(i);
  const std::size_t n = sh_count(db_);
  const shading::ShRotation to_flat = shading::sh_rotation(glm::transpose(at.to_fibre));
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const std::size_t row =
        (std::size_t{material_of_segment_[segment]} * 3 + channel) * shading::kBcsdfShAngles + i;
    const float* low = db_.c_s.data() + row * n;
    shading::ShVector c = shading::sh_zero();
    for (std::size_t j = 0; j < n; ++j) {
      c.c[j] = low[j] + f * (low[n + j] - low[j]);
    }
    at.c_s[channel] = shading::sh_rotate(to_flat, c);
  }
  return at;
}

float PrecomputedFabric::signed_distance(std::uint32_t segment, glm::vec3 omega) const {
  const float share = core::float_from_half(db_.open_share[segment]);
  if (share <= 0) {
    return -shading::kPi;
  }
  const float above_horizon = std::asin(std::clamp(omega.z, -1.0f, 1.0f));
  if (share >= 1) {
    return above_horizon;
  }
  const std::size_t components = db_.pca_components;
  const std::uint16_t* coefficients = db_.ssdf.data() + segment * components;
  const shading::MapFootprint footprint =
      shading::map_footprint(omega, static_cast<int>(db_.visibility_resolution));
  std::array<const float*, 4> pixel{};
  float distance = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    pixel[k] = basis_.data() + static_cast<std::size_t>(footprint.index[k]) * (components + 1);
    distance += footprint.weight[k] * *pixel[k]++;
  }
  for (std::size_t c = 0; c < components; ++c) {
    const float value = footprint.weight[0] * pixel[0][c] + footprint.weight[1] * pixel[1][c] +
                        footprint.weight[2] * pixel[2][c] + footprint.weight[3] * pixel[3][c];
    distance += value * core::float_from_half(coefficients[c]);
  }
  return std::min(distance, above_horizon);
}

bool PrecomputedFabric::sees(std::uint32_t segment, glm::vec3 omega) const {
  return omega.z > 0 && signed_distance(segment, omega) > 0;
}

}  // namespace weft::render
