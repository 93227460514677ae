#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "shading/fibre_bcsdf.h"
#include "shading/lobe_normalisation.h"
#include "shading/quadrature.h"
#include "tests/shading_fibres.h"
#include "tests/shading_statistics.h"
#include "tests/shading_vectors.h"

namespace weft::shading {
namespace {

constexpr double kPiExact = std::numbers::pi;
constexpr std::uint64_t kSeed = 20170417;

TEST(FibreBcsdf, HasTheReferenceValuesOfBothLobes) {
  for (const auto& v : vectors::kLobes) {
    const vectors::Fibre& f = vectors::kFibres[v.fibre];
    const FibreBcsdf& bcsdf = published(v.fibre);
    const glm::vec3 omega_i = fibre_direction(v.theta_i, v.phi + 0.7);
    const glm::vec3 omega_o = fibre_direction(v.theta_o, 0.7);
    const FibreAngle i = fibre_angle(omega_i);
    const FibreAngle o = fibre_angle(omega_o);
    const LobePair s =
        bcsdf_lobes(bcsdf.lobes(), i, lobe_gaussians(bcsdf.lobes(), i.theta, o.theta),
                    cos_phi_between(omega_i, i, omega_o, o));
    // Directions are floats: an angle is good to 1e-7, which the exponents multiply by the
    // lobes' steepness |theta_i + theta_o| / beta^2 and kappa; the table adds 3e-5.
    const double d = std::abs(v.theta_i + v.theta_o);
    const double tol_r = 5e-5 + 3e-7 * d / (f.beta_r * f.beta_r);
    const double tol_tt =
        5e-5 + 3e-7 * (d / (f.beta_tt * f.beta_tt) + 1 / (f.gamma_tt * f.gamma_tt));
    EXPECT_NEAR(s.r.x, v.s_r, tol_r * v.s_r + 1e-30) << f.name << " " << v.theta_i;
    EXPECT_NEAR(s.tt.x, v.s_tt, tol_tt * v.s_tt + 1e-30) << f.name << " " << v.theta_i;
    EXPECT_NEAR(fresnel(bcsdf.lobes().c_r, i.cos_theta).x, v.f_r, 1e-6);
    EXPECT_EQ(bcsdf.evaluate(omega_i, omega_o), s.r + s.tt);
  }
}

TEST(FibreBcsdf, ConservesThePowerOfEveryIncidentRay) {
  // Integral of S cos(theta_o) over omega_o = F + (1 - F) C_TT, to the accuracy of float.
  const QuadratureRule rule = gauss_legendre(32);
  for (const auto& v : vectors::kForwardAlbedo) {
    const vectors::Fibre& f = vectors::kFibres[v.fibre];
    const FibreBcsdf& bcsdf = published(v.fibre);
    const glm::vec3 omega_i = fibre_direction(v.theta_i, 0.2);
    const auto over_phi = [&](double theta_o) {
      double sum = 0;
      for (int k = 0; k < 48; ++k) {
        sum += bcsdf.evaluate(omega_i, fibre_direction(theta_o, 2 * kPiExact * k / 48)).x;
      }
      const double c = std::cos(theta_o);
      return sum * 2 * kPiExact / 48 * c * c;
    };
    // The narrow reflection lobe and the wide transmission lobe have pieces of their own.
    std::vector<double> edges{-kPiExact / 2, kPiExact / 2};
    for (const double width : {f.beta_r, f.beta_tt}) {
      for (const double side : {-8.0, 8.0}) {
        edges.push_back(std::clamp(-v.theta_i + side * width, -kPiExact / 2, kPiExact / 2));
      }
    }
    std::sort(edges.begin(), edges.end());
    double power = 0;
    for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
      power += integrate(rule, edges[k], edges[k + 1], over_phi);
    }
    EXPECT_NEAR(power, v.r + v.tt, 1e-4) << f.name << " theta_i " << v.theta_i;
  }
}

TEST(FibreBcsdf, TabulatesTheAdjointAlbedo) {
  for (const auto& v : vectors::kAdjointAlbedo) {
    const vectors::Fibre& f = vectors::kFibres[v.fibre];
    const AdjointMoments r = adjoint_moments(v.theta_o, LobeNormalisation(f.beta_r));
    const AdjointMoments tt = adjoint_moments(v.theta_o, LobeNormalisation(f.beta_tt));
    EXPECT_NEAR(f.c_r * r.plain + (1 - f.c_r) * r.schlick, v.r, 1e-9) << f.name;
    EXPECT_NEAR(f.c_tt * (1 - f.c_r) * (tt.plain - tt.schlick), v.tt, 1e-9) << f.name;
    const FibreBcsdf& bcsdf = published(v.fibre);
    for (const double side : {-1.0, 1.0}) {
      EXPECT_NEAR(bcsdf.adjoint_albedo(static_cast<float>(side * v.theta_o)).x, v.r + v.tt, 5e-5)
          << f.name << " theta_o " << v.theta_o;
    }
  }
}

TEST(FibreBcsdf, InterpolatesItsNormalisation) {
  for (const double beta : {0.01, 0.05, 0.1, 0.3, 0.6, 1.5}) {
    const LobeNormalisation norm(beta);
    EXPECT_EQ(norm.beta(), beta);
    for (int i = -1000; i <= 1000; ++i) {
      const double mu = kPiExact / 2 * i / 1000;
      const double exact = lobe_normalisation(mu, beta);
      EXPECT_NEAR(norm(mu), exact, 1e-12 * exact) << beta << " " << mu;
    }
  }
}

TEST(FibreBcsdf, NormalisesAtGrazing) {
  std::map<double, FibreBcsdf> made;  // a table per width
  for (const auto& v : vectors::kNormalisation) {
    EXPECT_NEAR(lobe_normalisation(v.mu, v.beta), v.value, 1e-10 * v.value + 1e-13);
    EXPECT_NEAR(lobe_normalisation(-v.mu, v.beta), v.value, 1e-10 * v.value + 1e-13);
    FibreMaterial m;
    m.beta_r = static_cast<float>(v.beta);
    const FibreBcsdf& bcsdf = made.try_emplace(v.beta, m).first->second;
    const auto pole = static_cast<float>(kPiExact / 2 - v.mu);
    const double scale = std::sqrt(2 * kPiExact) * v.beta;
    EXPECT_NEAR(lobe_norm(bcsdf.lobes(), pole).x / scale, v.value, 1e-4 * v.value);
  }
}

// One sampling case: a material and an outgoing longitude.
class FibreBcsdfSampling : public testing::TestWithParam<std::tuple<std::size_t, double>> {
 protected:
  [[nodiscard]] const vectors::Fibre& fibre() const {
    return vectors::kFibres[std::get<0>(GetParam())];
  }
  [[nodiscard]] double theta_o() const { return std::get<1>(GetParam()); }
  [[nodiscard]] glm::vec3 omega_o() const { return fibre_direction(theta_o(), kPhiO); }
  [[nodiscard]] BcsdfSample draw(const FibreBcsdf& bcsdf, std::uint64_t index) const {
    core::Random random(kSeed, static_cast<std::uint32_t>(std::get<0>(GetParam())), index);
    const float a = random.uniform();
    const float b = random.uniform();
    return bcsdf.sample(omega_o(), a, b, random.uniform());
  }
  static constexpr double kPhiO = -0.4;
  static constexpr int kCases = 24;
};

// Edges of cells in theta that are narrow where either lobe is.
std::vector<double> theta_edges(const vectors::Fibre& fibre, double theta_o) {
  std::vector<double> edges{-kPiExact / 2, kPiExact / 2};
  for (const double width : {fibre.beta_r, fibre.beta_tt}) {
    for (int k = -8; k <= 8; ++k) {
      edges.push_back(std::clamp(-theta_o + 0.4 * k * width, -kPiExact / 2, kPiExact / 2));
    }
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

constexpr std::size_t kColumns = 24;

// Probability of every cell [theta edges - 1, kColumns of phi].
std::vector<double> cell_masses(const FibreBcsdf& bcsdf, glm::vec3 omega_o,
                                const std::vector<double>& edges) {
  const QuadratureRule rule = gauss_legendre(8);
  const double width = 2 * kPiExact / kColumns;
  std::vector<double> masses((edges.size() - 1) * kColumns);
  for (std::size_t cell = 0; cell < masses.size(); ++cell) {
    const double low = -kPiExact + width * static_cast<double>(cell % kColumns);
    const auto over_phi = [&](double theta) {
      return std::cos(theta) * integrate(rule, low, low + width, [&](double phi) {
               return bcsdf.pdf(fibre_direction(theta, phi), omega_o);
             });
    };
    masses[cell] = integrate(rule, edges[cell / kColumns], edges[cell / kColumns + 1], over_phi);
  }
  return masses;
}

std::size_t cell_of(glm::vec3 w, const std::vector<double>& edges) {
  const double theta = fibre_angle(w).theta;
  const double phi = std::atan2(w.z, w.y);
  const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, theta);
  const auto row = static_cast<std::size_t>(above - edges.begin() - 1);
  const auto column = static_cast<std::size_t>((phi + kPiExact) / (2 * kPiExact) * kColumns);
  return row * kColumns + std::min(column, kColumns - 1);
}

TEST_P(FibreBcsdfSampling, DrawsFromItsDensity) {
  const FibreBcsdf& bcsdf = published(std::get<0>(GetParam()));
  const std::vector<double> edges = theta_edges(fibre(), theta_o());
  std::vector<double> expected = cell_masses(bcsdf, omega_o(), edges);
  constexpr int kSamples = 100000;
  double total = 0;
  for (double& mass : expected) {
    total += mass;
    mass *= kSamples;
  }
  EXPECT_NEAR(total, 1, 3e-4);
  std::vector<double> observed(expected.size());
  for (int n = 0; n < kSamples; ++n) {
    observed[cell_of(draw(bcsdf, static_cast<std::uint64_t>(n)).omega_i, edges)] += 1;
  }
  EXPECT_GT(chi_square_p_value(observed, expected), sidak_level(kCases));
}

TEST_P(FibreBcsdfSampling, WeighsSamplesByTheirDensity) {
  const FibreBcsdf& bcsdf = published(std::get<0>(GetParam()));
  for (std::uint64_t n = 0; n < 2000; ++n) {
    const BcsdfSample s = draw(bcsdf, n);
    ASSERT_GT(s.pdf, 0);
    ASSERT_NEAR(glm::length(s.omega_i), 1, 1e-6);
    const double pdf = bcsdf.pdf(s.omega_i, omega_o());
    // Angles are floats here: narrow lobes multiply their rounding, most of all at grazing, where
    // 1 / cos(theta_i) does too.
    const double cosine = fibre_angle(s.omega_i).cos_theta;
    ASSERT_NEAR(s.pdf, pdf, pdf * (4e-4 + 1e-6 / cosine));
    const glm::vec3 weight = bcsdf.evaluate_cos(s.omega_i, omega_o()) / s.pdf;
    ASSERT_NEAR(s.weight.x, weight.x, (4e-4 + 1e-6 / cosine) * weight.x);
    ASSERT_LT(s.weight.x, 3);
  }
}

TEST_P(FibreBcsdfSampling, WeightsAverageToTheAdjointAlbedo) {
  const FibreBcsdf& bcsdf = published(std::get<0>(GetParam()));
  constexpr int kSamples = 100000;
  double sum = 0;
  double squares = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double w = draw(bcsdf, static_cast<std::uint64_t>(n)).weight.x;
    sum += w;
    squares += w * w;
  }
  const double mean = sum / kSamples;
  const double error = std::sqrt((squares / kSamples - mean * mean) / kSamples);
  const double albedo = bcsdf.adjoint_albedo(static_cast<float>(theta_o())).x;
  // Two-sided 0.01 over all cases (Sidak): 3.7 standard errors; tables and floats 1e-4.
  EXPECT_NEAR(mean, albedo, 3.7 * error + 1e-4);
}

INSTANTIATE_TEST_SUITE_P(PublishedMaterials, FibreBcsdfSampling,
                         testing::Combine(testing::Values(0, 1, 2, 3),
                                          testing::Values(0.0, 0.5, -1.0, 1.35, 1.5, -1.5707963)));

void expect_finite(float value, float pdf) {
  EXPECT_TRUE(std::isfinite(value) && value >= 0) << value;
  EXPECT_TRUE(std::isfinite(pdf) && pdf >= 0) << pdf;
}

// Samples at the corners of the unit cube.
void expect_sound_corners(const FibreBcsdf& bcsdf, glm::vec3 omega_o) {
  constexpr std::array<float, 5> kCorners{0.0f, 0x1p-24f, 0.25f, 0.5f, 1.0f - 0x1p-24f};
  for (std::size_t n = 0; n < 125; ++n) {
    const BcsdfSample s =
        bcsdf.sample(omega_o, kCorners[n / 25], kCorners[n / 5 % 5], kCorners[n % 5]);
    expect_finite(s.weight.x, s.pdf);
    EXPECT_LT(s.weight.x, 3);
    EXPECT_NEAR(glm::length(s.omega_i), 1, 1e-6);
  }
}

TEST(FibreBcsdf, HoldsAtTheFibresAxis) {
  const float half = static_cast<float>(kPiExact / 2);
  std::vector<glm::vec3> directions{{1, 0, 0},
                                    {-1, 0, 0},
                                    {0, 1, 0},
                                    {0, 0, -1},
                                    {1, 1e-20f, 0},
                                    {-1, 0, 1e-8f},
                                    fibre_direction(half, 0.3),
                                    fibre_direction(-half, 3)};
  for (std::size_t k = 0; k < vectors::kFibres.size(); ++k) {
    const FibreBcsdf& bcsdf = published(k);
    for (const glm::vec3 o : directions) {
      for (const glm::vec3 i : directions) {
        expect_finite(bcsdf.evaluate(i, o).x, bcsdf.pdf(i, o));
      }
      expect_sound_corners(bcsdf, o);
    }
    EXPECT_TRUE(std::isfinite(bcsdf.adjoint_albedo(half).x));
  }
}

TEST(FibreBcsdf, DoesNotCareWhichWayTheTangentPoints) {
  const FibreBcsdf bcsdf(grey_material(vectors::kGabardineR));
  const glm::vec3 i = fibre_direction(0.3, 2.8);
  const glm::vec3 o = fibre_direction(-0.35, 0.1);
  // u -> -u keeps the frame right-handed by turning z: (x, y, z) -> (-x, y, -z).
  const glm::vec3 mirrored_i(-i.x, i.y, -i.z);
  const glm::vec3 mirrored_o(-o.x, o.y, -o.z);
  EXPECT_FLOAT_EQ(bcsdf.evaluate(i, o).x, bcsdf.evaluate(mirrored_i, mirrored_o).x);
}

TEST(FibreBcsdf, BlackMaterialHasNoTransmission) {
  FibreMaterial m;
  m.beta_r = 0.1f;
  const FibreBcsdf bcsdf(m);
  EXPECT_NEAR(bcsdf.adjoint_albedo(0.2f).x, bcsdf.adjoint_albedo(0.2f).y, 0);
  EXPECT_LT(bcsdf.adjoint_albedo(0.0f).x, 1e-3f);  // only Schlick's term is left
  const BcsdfSample s = bcsdf.sample({0, 1, 0}, 0.999f, 0.5f, 0.25f);
  EXPECT_GT(s.pdf, 0);
  EXPECT_LT(s.weight.x, 1e-3f);
}

TEST(FibreBcsdf, FurnaceHasWeightOneAndDensityCosineOverPiSquared) {
  const FibreBcsdf furnace = FibreBcsdf::furnace();
  EXPECT_TRUE(furnace.is_furnace());
  const glm::vec3 o = fibre_direction(0.4, 1);
  constexpr int kSamples = 100000;
  constexpr std::size_t kRows = 16;
  constexpr std::size_t kSectors = 8;
  std::vector<double> observed(kRows * kSectors);
  std::vector<double> expected(kRows * kSectors);
  for (int n = 0; n < kSamples; ++n) {
    core::Random random(kSeed, 9, static_cast<std::uint64_t>(n));
    const float a = random.uniform();
    const float b = random.uniform();
    const BcsdfSample s = furnace.sample(o, a, b, random.uniform());
    ASSERT_EQ(s.weight, glm::vec3(1));
    ASSERT_NEAR(s.pdf, furnace.pdf(s.omega_i, o), 1e-5f * s.pdf + 1e-7f);
    const auto row = std::min(static_cast<std::size_t>((s.omega_i.x + 1) / 2 * kRows), kRows - 1);
    const double phi = std::atan2(s.omega_i.z, s.omega_i.y) + kPiExact;
    const auto column =
        std::min(static_cast<std::size_t>(phi / (2 * kPiExact) * kSectors), kSectors - 1);
    observed[row * kSectors + column] += 1;
  }
  const QuadratureRule rule = gauss_legendre(16);
  for (std::size_t row = 0; row < kRows; ++row) {
    const double low = std::asin(-1 + 2.0 * static_cast<double>(row) / kRows);
    const double high = std::asin(std::min(1.0, -1 + 2.0 * static_cast<double>(row + 1) / kRows));
    const double mass = integrate(rule, low, high, [&](double theta) {
      return furnace.pdf(fibre_direction(theta, 0), o) * std::cos(theta);
    });
    for (std::size_t column = 0; column < kSectors; ++column) {
      expected[row * kSectors + column] = mass * 2 * kPiExact / kSectors * kSamples;
    }
  }
  EXPECT_GT(chi_square_p_value(observed, expected), 0.01);
  EXPECT_FLOAT_EQ(furnace.evaluate(o, o).x, static_cast<float>(1 / (kPiExact * kPiExact)));
}

TEST(FibreFrame, HasTheTangentAndTheViewerInItsPlane) {
  const glm::vec3 tangent = glm::normalize(glm::vec3(1, -2, 0.5f));
  const glm::vec3 omega_o = glm::normalize(glm::vec3(0.3f, 0.4f, 0.9f));
  const glm::mat3 frame = fibre_frame(tangent, omega_o);
  const glm::vec3 x = frame * tangent;
  EXPECT_NEAR(glm::length(x - glm::vec3(1, 0, 0)), 0, 1e-6);
  const glm::vec3 o = frame * omega_o;
  EXPECT_NEAR(o.z, 0, 1e-6);
  EXPECT_GT(o.y, 0);
  for (const glm::vec3 axis : {tangent, -tangent, tangent + glm::vec3(1e-9f, 0, 0)}) {
    const glm::mat3 f = fibre_frame(tangent, axis);
    EXPECT_NEAR(glm::dot(glm::cross(f * glm::vec3(1, 0, 0), f * glm::vec3(0, 1, 0)),
                         f * glm::vec3(0, 0, 1)),
                1, 1e-5);
  }
}

}  // namespace
}  // namespace weft::shading
