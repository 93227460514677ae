#include <cmath>
#include <memory>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/half.h"
#include "core/random.h"
#include "render/traced_terms.h"
#include "shading/bcsdf_sh.h"

namespace weft::render {
namespace {

constexpr float kPitchMm = 0.25f;
constexpr std::uint32_t kFibresPerLayer = 4;

shading::FibreMaterial wide_material() {
  shading::FibreMaterial result;
  result.c_r = {0.3f, 0.2f, 0.1f};
  result.c_tt = {0.6f, 0.5f, 0.4f};
  result.beta_r = 0.2f;
  result.beta_tt = 0.3f;
  result.gamma_tt = 0.5f;
  return result;
}

// Two layers of parallel fibres along x, one straight above the other, two segments each, in one
// cell. Nothing is tabulated: the traced terms read the geometry and the cells alone.
std::unique_ptr<Fabric> two_layers() {
  storage::FabricDatabase db;
  db.size_mm = {1, kPitchMm * kFibresPerLayer};
  db.z_bounds_mm = {-0.15f, 0.15f};
  db.material_names = {"grey"};
  db.yarn_names = {"yarn"};
  db.threads = {0, 3, 0};
  for (std::uint32_t i = 0; i < 2 * kFibresPerLayer; ++i) {
    const float y = (static_cast<float>(i % kFibresPerLayer) + 0.5f) * kPitchMm;
    const float z = i < kFibresPerLayer ? 0.1f : -0.1f;
    db.strands.insert(db.strands.end(), {3, 0, 0});
    db.strand_periods.insert(db.strand_periods.end(), {1, 0});
    db.strand_radius_mm.push_back(0.05f);
    db.points_mm.insert(db.points_mm.end(), {0, y, z, 0.5f, y, z, 1, y, z});
  }
  const std::size_t segments = 4 * kFibresPerLayer;
  db.materials = {wide_material()};
  db.c_s = shading::bcsdf_sh_table(wide_material(), 0);
  db.cell_of_segment.assign(segments, 0);
  db.cell_coordinates = {0, 0, 0};
  db.cell_paths = {1};
  db.transfer.assign(3, 0.0f);
  db.transfer_se.assign(3, 0.0f);
  db.visibility_resolution = 8;
  db.pca_components = 1;
  db.ssdf_mean.assign(64, 3.0f);
  db.ssdf_basis.assign(64, 0.0f);
  db.ssdf.assign(segments, 0);
  db.sg_count = 1;
  db.sg_sharpness = 128;
  db.ssg.assign(segments, 0);
  db.ssg_rotation.assign(segments, 0);
  db.open_share.assign(segments, core::half_from_float(1));
  return Fabric::from_database(std::move(db), Fabric::Wanted::kFibresAndTransfer);
}

struct Mean {
  double value = 0;
  double error = 0;
};

Mean mean_of_multiple(const TracedTerms& terms, const ShadingPoint& at, TermSource source,
                      std::uint32_t stream) {
  const glm::vec3 omega_d = glm::normalize(glm::vec3(0.2f, 0.3f, 1));
  constexpr int kPaths = 60000;
  double sum = 0;
  double squares = 0;
  for (std::uint64_t i = 0; i < kPaths; ++i) {
    core::Random random(11, stream, i);
    const auto value = static_cast<double>(terms.multiple(at, omega_d, source, random).x);
    sum += value;
    squares += value * value;
  }
  const double mean = sum / kPaths;
  return {mean, std::sqrt((squares / kPaths - mean * mean) / kPaths)};
}

TEST(TracedTerms, SingleIsLightThatTheSegmentSees) {
  const auto fabric = two_layers();
  const TracedTerms terms(*fabric);
  const glm::vec3 up(0, 0, 1);
  const ShadingPoint upper = fabric->precomputed()->point(0, {1, 0, 0}, up);
  const ShadingPoint lower = fabric->precomputed()->point(2 * kFibresPerLayer, {1, 0, 0}, up);
  EXPECT_EQ(terms.single(upper, up), PrecomputedFabric::unoccluded_directional(upper, up));
  EXPECT_GT(terms.single(upper, up).x, 0);
  EXPECT_EQ(terms.single(lower, up), glm::vec3(0));  // straight under the upper one
  const glm::vec3 between = glm::normalize(glm::vec3(0, 0.125f, 0.2f));
  EXPECT_EQ(terms.single(lower, between),
            PrecomputedFabric::unoccluded_directional(lower, between));
}

// All segments of a layer are alike, so a cell is a mixture of two: the upper layer, which the eye
// meets more often, and the lower one.
TEST(TracedTerms, ACellIsTheMeanOfItsSegmentsAsTheyAreSeen) {
  const auto fabric = two_layers();
  const TracedTerms terms(*fabric);
  const glm::vec3 omega_o = glm::normalize(glm::vec3(0.1f, -0.2f, 1));
  const ShadingPoint upper = fabric->precomputed()->point(0, {1, 0, 0}, omega_o);
  const ShadingPoint lower = fabric->precomputed()->point(2 * kFibresPerLayer, {1, 0, 0}, omega_o);
  const auto seen = transport::seen_segments(fabric->scene(), 1024, 5);
  double of_upper = 0;
  double of_lower = 0;
  for (std::uint32_t k = 0; k < seen.size(); ++k) {
    (k < 2 * kFibresPerLayer ? of_upper : of_lower) += seen[k];
  }
  const double share = of_upper / (of_upper + of_lower);
  const Mean up = mean_of_multiple(terms, upper, TermSource::kSegment, 1);
  const Mean low = mean_of_multiple(terms, lower, TermSource::kSegment, 2);
  const Mean cell = mean_of_multiple(terms, upper, TermSource::kCell, 3);
  EXPECT_GT(std::fabs(up.value - low.value), 10 * std::hypot(up.error, low.error));
  const double expected = share * up.value + (1 - share) * low.value;
  // The terms' own counts, 16 rays for each of 16 segments, are off by 3 % of the share.
  const double of_counts = 0.06 * std::fabs(up.value - low.value);
  EXPECT_NEAR(
      cell.value, expected,
      2.6 * std::sqrt(cell.error * cell.error + up.error * up.error + low.error * low.error) +
          of_counts);
}

}  // namespace
}  // namespace weft::render
