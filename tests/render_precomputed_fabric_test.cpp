#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/half.h"
#include "core/random.h"
#include "render/precomputed_fabric.h"
#include "shading/bcsdf_sh.h"
#include "shading/visibility.h"
#include "tests/shading_fibres.h"
#include "tests/shading_sh_vectors.h"
#include "tests/shading_vectors.h"

namespace weft::render {
namespace {

namespace vectors = shading::vectors;
using shading::ShVector;
using shading::SphericalGaussian;

constexpr int kResolution = 128;
constexpr std::size_t kShCount = 36;

// What each segment of the synthetic fabric sees.
constexpr std::uint32_t kOpen = 0;
constexpr std::uint32_t kBlocked = 1;
constexpr std::uint32_t kHalfSpace = 2;  // omega . kEdge > 0
constexpr std::uint32_t kSegments = 3;
const glm::vec3 kEdge = glm::normalize(glm::vec3(1, 0.4f, 0.5f));

glm::vec3 to_vec3(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

// Visibility weights of a segment that sees the directions for which `open` holds.
std::vector<std::uint16_t> sg_weights(int count, float turn,
                                      const std::function<bool(glm::vec3)>& open) {
  std::vector<float> weights(static_cast<std::size_t>(count));
  for (int pixel = 0; pixel < kResolution * kResolution; ++pixel) {
    const int row = pixel / kResolution;
    const glm::vec3 w = shading::map_direction(row, pixel % kResolution, kResolution);
    if (w.z <= 0 || !open(w)) {
      continue;
    }
    int best = 0;
    for (int q = 1; q < count; ++q) {
      if (glm::dot(shading::fibonacci_axis(q, count, turn), w) >
          glm::dot(shading::fibonacci_axis(best, count, turn), w)) {
        best = q;
      }
    }
    weights[static_cast<std::size_t>(best)] += shading::map_solid_angle(row, kResolution);
  }
  std::vector<std::uint16_t> halves;
  halves.reserve(weights.size());
  for (const float w : weights) {
    halves.push_back(core::half_from_float(w));
  }
  return halves;
}

// One strand of three segments along x that see everything, nothing and a half-space. Two
// components: the half-space's signed distance, halved, in the mean and in the basis; and noise
// that the coefficients leave out.
storage::FabricDatabase synthetic(const shading::FibreMaterial& material, int sg_count) {
  storage::FabricDatabase db;
  db.size_mm = {1, 1};
  db.z_bounds_mm = {-1, 1};
  db.strands = {kSegments + 1, 0, 0};
  db.materials = {material};
  db.c_s = shading::bcsdf_sh_table(material, shading::kShMaxOrder);
  db.cell_of_segment = {0, 1, 1};
  db.sh_order = shading::kShMaxOrder;
  db.cell_paths = {1, 1};
  db.transfer.assign(std::size_t{2} * 3 * kShCount * kShCount, 0.0f);
  db.visibility_resolution = kResolution;
  db.pca_components = 2;
  for (int pixel = 0; pixel < kResolution * kResolution; ++pixel) {
    const glm::vec3 w =
        shading::map_direction(pixel / kResolution, pixel % kResolution, kResolution);
    db.ssdf_mean.push_back(0.5f * std::asin(glm::dot(w, kEdge)));
  }
  db.ssdf_basis = db.ssdf_mean;
  core::Random random(11, 0);
  for (std::size_t pixel = 0; pixel < db.ssdf_mean.size(); ++pixel) {
    db.ssdf_basis.push_back(random.uniform());
  }
  const std::uint16_t one = core::half_from_float(1);
  db.ssdf = {0, 0, 0, 0, one, 0};
  db.sg_count = static_cast<std::uint32_t>(sg_count);
  db.sg_sharpness = 128;
  db.ssg_rotation = {0, 0, 9000};
  const float turn = 9000 * shading::kTwoPi / 65536;
  const std::vector<std::vector<std::uint16_t>> weights{
      sg_weights(sg_count, 0, [](glm::vec3) { return true; }),
      sg_weights(sg_count, 0, [](glm::vec3) { return false; }),
      sg_weights(sg_count, turn, [](glm::vec3 w) { return glm::dot(w, kEdge) > 0; })};
  for (const std::vector<std::uint16_t>& w : weights) {
    db.ssg.insert(db.ssg.end(), w.begin(), w.end());
  }
  db.open_share = {one, 0, core::half_from_float(0.5f)};
  return db;
}

shading::FibreMaterial material() {
  shading::FibreMaterial m = shading::grey_material(vectors::kFleeceG);
  m.c_tt = {0.4f, 0.7f, 0.95f};
  return m;
}

// Made once: the tables take longer than the tests.
const PrecomputedFabric& fabric() {
  static const PrecomputedFabric made(synthetic(material(), 48));
  return made;
}

const glm::vec3 kTangent = glm::normalize(glm::vec3(0.8f, -0.3f, 0.2f));
const glm::vec3 kOmegaO = glm::normalize(glm::vec3(0.2f, 0.1f, 0.9f));

// Integral of the normalised light over the visible directions above the horizon times S cos, by a
// midpoint sum over the sphere.
double brute_single(const ShadingPoint& at, const SphericalGaussian& light,
                    const std::function<bool(glm::vec3)>& open) {
  constexpr int kRows = 600;
  constexpr int kColumns = 1200;
  double sum = 0;
  for (int row = 0; row < kRows; ++row) {
    const double z = 1 - (row + 0.5) / kRows;
    const double s = std::sqrt(1 - z * z);
    for (int column = 0; column < kColumns; ++column) {
      const double phi = 2 * std::numbers::pi * column / kColumns;
      const glm::vec3 w(static_cast<float>(s * std::cos(phi)),
                        static_cast<float>(s * std::sin(phi)), static_cast<float>(z));
      const float g = shading::sg_evaluate(light, w);
      if (g > 1e-7f && open(w)) {
        sum += g * PrecomputedFabric::unoccluded_directional(at, w).y;
      }
    }
  }
  return sum * 2 * std::numbers::pi / kRows / kColumns / shading::sg_mass(light.sharpness);
}

TEST(PrecomputedFabric, OpenSegmentsShadeAsIfAlone) {
  const ShadingPoint at = fabric().point(kOpen, kTangent, kOmegaO);
  const shading::FibreBcsdf alone(material());
  const glm::mat3 frame = shading::fibre_frame(kTangent, kOmegaO);
  for (const glm::vec3 towards : {glm::vec3(0, 0, 1), glm::vec3(0.48f, 0.6f, 0.64f)}) {
    const glm::vec3 expected = alone.evaluate_cos(frame * towards, frame * kOmegaO);
    EXPECT_EQ(fabric().single_directional(at, towards), expected);
    // At sharpness 1000 the Gaussian's own width still matters, its horizon does not.
    const glm::vec3 gamma = shading::gamma_integral(
        alone.lobes(), {frame * towards, 1000}, frame * kOmegaO, fabric().settings().gamma_method);
    const glm::vec3 sg = fabric().single_sg(at, {towards, 1000});
    EXPECT_NEAR(sg.y, gamma.y / shading::sg_mass(1000), 1e-5 * sg.y);
  }
}

TEST(PrecomputedFabric, SumOfGaussiansOverTheOpenSkyIsNearTheSkyItself) {
  // 192 axes leave a ripple below three percent at sharpness 10 (48 have more).
  const PrecomputedFabric fine(synthetic(material(), 192));
  const ShadingPoint at = fine.point(kOpen, kTangent, kOmegaO);
  const SphericalGaussian light{glm::normalize(glm::vec3(0.1f, 0.3f, 0.9f)), 10};
  const double exact = brute_single(at, light, [](glm::vec3) { return true; });
  EXPECT_NEAR(fine.single_sg(at, light).y, exact, 0.03 * exact);
}

TEST(PrecomputedFabric, BlockedSegmentsScatterNothingOnce) {
  const ShadingPoint at = fabric().point(kBlocked, kTangent, kOmegaO);
  EXPECT_EQ(fabric().single_directional(at, {0, 0, 1}), glm::vec3(0));
  for (const float sharpness : {5.0f, 150.0f, 2000.0f}) {
    EXPECT_EQ(fabric().single_sg(at, {{0, 0, 1}, sharpness}), glm::vec3(0));
  }
}

TEST(PrecomputedFabric, DecodesTheSignedDistanceOfAHalfSpace) {
  core::Random random(5, 5);
  for (int n = 0; n < 2000; ++n) {
    const float z = random.uniform();
    const float phi = shading::kTwoPi * random.uniform();
    const float s = std::sqrt(1 - z * z);
    const glm::vec3 w(s * std::cos(phi), s * std::sin(phi), z);
    const float edge = std::asin(glm::dot(w, kEdge));
    // Bilinear interpolation of a function of curvature at most one per pixel of 0.05 rad; more
    // where the distance has its kink, at kEdge itself.
    const float tolerance = edge > 1.45f ? 3e-2f : 2e-3f;
    ASSERT_NEAR(fabric().signed_distance(kHalfSpace, w), std::min(edge, std::asin(z)), tolerance);
    if (std::abs(edge) > 2e-3f && z > 1e-4f) {
      ASSERT_EQ(fabric().sees(kHalfSpace, w), edge > 0);
    }
  }
}

TEST(PrecomputedFabric, HalfSpaceDimsAGaussianLightByItsEdge) {
  // The edge runs along the fibre and cuts the Gaussian in phi, in which S varies slowly. Cut in
  // theta, on the flank of the reflection lobe, V Gamma is off by a factor.
  const glm::vec3 tangent = glm::normalize(glm::cross(kEdge, glm::vec3(0, 0, 1)));
  const ShadingPoint at = fabric().point(kHalfSpace, tangent, kOmegaO);
  const auto open = [](glm::vec3 w) { return glm::dot(w, kEdge) > 0; };
  // Towards the light: inside, at and outside the edge, all far above the horizon.
  const glm::vec3 across = glm::normalize(glm::vec3(0, 0, 1) - kEdge * kEdge.z);
  for (const float angle : {0.15f, 0.0f, -0.08f}) {
    const glm::vec3 towards = std::cos(angle) * across + std::sin(angle) * kEdge;
    const SphericalGaussian light{towards, 400};
    const double exact = brute_single(at, light, open);
    const double whole = fabric().unoccluded_sg(at, light).y;
    // V Gamma instead of the joint integral: S varies by some percent over a Gaussian of width
    // 0.05 rad, and its visible part is not its middle.
    EXPECT_NEAR(fabric().single_sg(at, light).y, exact, 0.04 * whole) << angle;
  }
}

TEST(PrecomputedFabric, BlendsBothVisibilitiesLinearly) {
  const ShadingPoint at = fabric().point(kHalfSpace, kTangent, kOmegaO);
  const SphericalGaussian light{{0, 0, 1}, 35};
  PrecomputedSettings gaussians;
  gaussians.blend_low = 1e6f;
  gaussians.blend_high = 2e6f;
  PrecomputedSettings distance;
  distance.blend_low = 0;
  distance.blend_high = 1;
  const PrecomputedFabric by_gaussians(synthetic(material(), 48), gaussians);
  const PrecomputedFabric by_distance(synthetic(material(), 48), distance);
  const float a =
      by_gaussians.single_sg(by_gaussians.point(kHalfSpace, kTangent, kOmegaO), light).y;
  const float b = by_distance.single_sg(by_distance.point(kHalfSpace, kTangent, kOmegaO), light).y;
  ASSERT_GT(std::abs(a - b), 1e-3f * b);
  EXPECT_NEAR(fabric().single_sg(at, light).y, 0.75f * a + 0.25f * b, 1e-6f);
}

TEST(PrecomputedFabric, SumOfGaussiansMatchesTheReference) {
  for (const auto& v : vectors::kSsgSingle) {
    storage::FabricDatabase db = synthetic(shading::grey_material(vectors::kFibres[v.fibre]), 48);
    db.ssg_rotation[kHalfSpace] = 0;
    for (int q = 0; q < 48; ++q) {
      const bool open = shading::fibonacci_axis(q, 48, 0).x > -0.2f;
      db.ssg[std::size_t{kHalfSpace} * 48 + static_cast<std::size_t>(q)] =
          core::half_from_float(open ? shading::kTwoPi / 48 : 0.0f);
    }
    PrecomputedSettings settings;
    settings.gamma_method = shading::kGammaClosed;
    settings.blend_low = 1e6f;
    settings.blend_high = 2e6f;
    const PrecomputedFabric made(std::move(db), settings);
    // The reference's frame: tangent x, omega_o towards y.
    const ShadingPoint at =
        made.point(kHalfSpace, {1, 0, 0}, shading::fibre_direction(v.theta_o, 0));
    const float radiance = made.single_sg(at, {to_vec3(v.xi), static_cast<float>(v.lambda)}).x;
    EXPECT_NEAR(radiance, v.radiance, 5e-4 * v.radiance);  // weights are halves
  }
}

TEST(PrecomputedFabric, MultipleScatteringMatchesTheReference) {
  for (const auto& v : vectors::kMultiScatter) {
    // A matrix that takes the light's constant coefficient to the reference's incoming light; its
    // green channel is the negative, its blue channel half of it.
    storage::FabricDatabase db = synthetic(shading::grey_material(vectors::kFibres[v.fibre]), 48);
    const glm::vec3 towards(0.48f, 0.6f, 0.64f);
    const ShVector c_light = harmonics_of_directional(towards);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const double factor = channel == 0 ? 1 : channel == 1 ? -1 : 0.5;
      for (std::size_t j1 = 0; j1 < kShCount; ++j1) {
        db.transfer[((3 + channel) * kShCount + j1) * kShCount] =
            static_cast<float>(factor * v.c_t[j1] / c_light.c[0]);
      }
    }
    const PrecomputedFabric made(std::move(db));
    const ShadingPoint at = made.point(kHalfSpace, to_vec3(v.tangent), to_vec3(v.omega_o));
    const glm::vec3 radiance = made.multiple(at, c_light);
    // Linear interpolation of C_S in theta_o costs up to 7e-4, times c_T of size one.
    EXPECT_NEAR(radiance.x, v.radiance, 2e-3);
    EXPECT_NEAR(radiance.y, -v.radiance, 2e-3);
    EXPECT_NEAR(radiance.z, 0.5 * v.radiance, 2e-3);
    EXPECT_GT(std::abs(v.radiance), 1e-2);
    const glm::vec3 cached = made.multiple(at, made.light_cells(c_light));
    EXPECT_EQ(cached, radiance);
    // The other cell has a matrix of zeros.
    EXPECT_EQ(made.multiple(made.point(kOpen, to_vec3(v.tangent), to_vec3(v.omega_o)), c_light),
              glm::vec3(0));
  }
}

TEST(PrecomputedFabric, UniformTransferIsSeenThroughTheAdjointAlbedo) {
  // T = 1 / (4 pi): light of unit irradiance arrives as radiance 1 / (4 pi) from everywhere.
  storage::FabricDatabase db = synthetic(material(), 48);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    db.transfer[(3 + channel) * kShCount * kShCount] = 1;  // <Y_0 Y_0, T> = 1
  }
  const PrecomputedFabric made(std::move(db));
  const ShadingPoint at = made.point(kBlocked, kTangent, kOmegaO);
  const shading::FibreBcsdf alone(material());
  const float theta_o = shading::fibre_angle(at.omega_o).theta;
  const glm::vec3 expected = alone.adjoint_albedo(theta_o) / shading::kFourPi;
  const glm::vec3 directional = made.multiple(at, harmonics_of_directional({0.6f, 0, 0.8f}));
  const glm::vec3 gaussian = made.multiple(at, harmonics_of_sg({{0.6f, 0, 0.8f}, 30}));
  for (int channel = 0; channel < 3; ++channel) {
    EXPECT_NEAR(directional[channel], expected[channel], 1e-4 * expected[channel]);
    EXPECT_NEAR(gaussian[channel], expected[channel], 1e-4 * expected[channel]);
  }
}

TEST(PrecomputedFabric, LightFromBelowTheHorizonCountsNothing) {
  const ShadingPoint at = fabric().point(kOpen, kTangent, kOmegaO);
  const glm::vec3 below = glm::normalize(glm::vec3(1, 0, -0.4f));
  EXPECT_EQ(fabric().single_directional(at, below), glm::vec3(0));
  const glm::vec3 sg = fabric().single_sg(at, {below, 1000});
  EXPECT_LT(sg.y, 1e-6f * fabric().unoccluded_sg(at, {below, 1000}).y);
  const ShVector none = harmonics_of_directional(below);
  EXPECT_EQ(shading::sh_dot(none, none), 0);
  // Half of a Gaussian at the horizon is below it.
  const SphericalGaussian level{{1, 0, 0}, 1000};
  EXPECT_NEAR(fabric().single_sg(at, level).y, 0.5f * fabric().unoccluded_sg(at, level).y,
              1e-5f * fabric().unoccluded_sg(at, level).y);
}

void expect_finite_shading(const ShadingPoint& at, glm::vec3 towards) {
  EXPECT_TRUE(std::isfinite(fabric().single_directional(at, towards).y));
  for (const float sharpness : {0.0f, 1.0f, 150.0f, 1e5f}) {
    EXPECT_TRUE(std::isfinite(fabric().single_sg(at, {towards, sharpness}).y)) << sharpness;
    EXPECT_TRUE(std::isfinite(harmonics_of_sg({towards, sharpness}).c[35])) << sharpness;
  }
}

TEST(PrecomputedFabric, HoldsAlongTheFibre) {
  for (const std::uint32_t segment : {kOpen, kHalfSpace}) {
    for (const glm::vec3 omega_o : {kTangent, -kTangent, glm::vec3(0, 0, 1)}) {
      const ShadingPoint at = fabric().point(segment, kTangent, omega_o);
      for (const glm::vec3 towards : {glm::vec3(0, 0, 1), kTangent, glm::vec3(1, 0, 0)}) {
        expect_finite_shading(at, towards);
      }
    }
  }
}

TEST(PrecomputedFabric, RefusesDatabasesThatContradictThemselves) {
  const storage::FabricDatabase good = synthetic(material(), 48);
  const std::vector<std::function<void(storage::FabricDatabase&)>> damages{
      [](auto& db) { db.transfer.pop_back(); },
      [](auto& db) { db.sh_order = 6; },
      [](auto& db) { db.cell_of_segment[1] = 7; },
      [](auto& db) { db.strands[0] = 9; },
      [](auto& db) { db.strands[0] = 0; },
      [](auto& db) { db.strands[1] = 1; },
      [](auto& db) { db.ssdf.clear(); },
      [](auto& db) { db.ssg.pop_back(); },
      [](auto& db) { db.open_share.pop_back(); },
      [](auto& db) { db.c_s.pop_back(); },
      [](auto& db) { db.visibility_resolution = 1; }};
  for (const auto& damage : damages) {
    storage::FabricDatabase bad = good;
    damage(bad);
    try {
      const PrecomputedFabric made(std::move(bad));
      FAIL() << "took a damaged database";
    } catch (const core::Error& error) {
      EXPECT_EQ(error.code(), core::Code::kDataLoss);
    }
  }
}

}  // namespace
}  // namespace weft::render
