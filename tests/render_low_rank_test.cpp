#include <cmath>

#include <gtest/gtest.h>

#include "render/baselines/low_rank_bcsdf.h"

namespace weft::render {
namespace {

shading::FibreMaterial material(float width) {
  shading::FibreMaterial result;
  result.c_r = {0.3f, 0.1f, 0.6f};
  result.c_tt = {0.6f, 0.9f, 0.2f};
  result.beta_r = result.beta_tt = width;
  result.gamma_tt = 0.5f;
  return result;
}

LowRankSettings small(std::uint32_t rank, bool weighted) {
  LowRankSettings settings;
  settings.rank = rank;
  settings.thetas = 48;
  settings.phis = 32;
  settings.weighted = weighted;
  return settings;
}

glm::dvec3 sum_of(const std::vector<LowRankBcsdf::Entry>& column) {
  glm::dvec3 sum(0);
  for (const LowRankBcsdf::Entry& entry : column) {
    sum += glm::dvec3(entry.weight);
  }
  return sum;
}

TEST(LowRankBcsdf, OfFullRankIsTheBcsdf) {
  const shading::FibreBcsdf bcsdf(material(0.15f));
  for (const bool weighted : {false, true}) {
    const LowRankBcsdf full(bcsdf, small(48 * 32, weighted));
    const float theta_o = nearest_theta(small(0, weighted), 0.5f);
    const glm::vec3 omega_o(std::sin(theta_o), std::cos(theta_o), 0);
    double norm = 0;
    double error = 0;
    for (const LowRankBcsdf::Entry& entry : full.column(theta_o)) {
      const glm::vec3 expected = bcsdf.evaluate_cos(entry.omega_i, omega_o);
      const double solid_angle =
          2 * 3.14159265358979 / 32 * 3.14159265358979 / 48 *
          std::hypot(static_cast<double>(entry.omega_i.y), static_cast<double>(entry.omega_i.z));
      for (int c = 0; c < 3; ++c) {
        norm = std::fmax(norm, expected[c] * solid_angle);
        error = std::fmax(error, std::fabs(entry.weight[c] - expected[c] * solid_angle));
      }
    }
    EXPECT_LT(error, 1e-3 * norm) << weighted;
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(full.kept_share()[c], 1, 1e-9);
      EXPECT_NEAR(sum_of(full.column(theta_o))[c], bcsdf.adjoint_albedo(theta_o)[c], 0.01);
    }
  }
}

TEST(LowRankBcsdf, KeepsLessOfNarrowLobesThanOfWideOnesAndMoreWithEveryTerm) {
  const LowRankBcsdf wide(shading::FibreBcsdf(material(0.6f)), small(16, true));
  const LowRankBcsdf narrow(shading::FibreBcsdf(material(0.08f)), small(16, true));
  const LowRankBcsdf more(shading::FibreBcsdf(material(0.08f)), small(64, true));
  for (int c = 0; c < 3; ++c) {
    EXPECT_GT(wide.kept_share()[c], 0.95);
    EXPECT_LT(1 - wide.kept_share()[c], 0.5 * (1 - narrow.kept_share()[c]));
    EXPECT_LT(1 - more.kept_share()[c], 0.5 * (1 - narrow.kept_share()[c]));
  }
}

TEST(LowRankBcsdf, OfThePlainMatrixIsBlackAwayFromTheFibresAxis) {
  // M = N / G grows without bound, for narrow lobes, towards the axis: all large singular values
  // live there.
  const shading::FibreBcsdf bcsdf(material(0.08f));
  const LowRankBcsdf plain(bcsdf, small(16, false));
  const float theta_o = nearest_theta(small(16, false), 0.4f);
  const glm::dvec3 sum = sum_of(plain.column(theta_o));
  for (int c = 0; c < 3; ++c) {
    EXPECT_LT(std::fabs(sum[c]), 0.05 * static_cast<double>(bcsdf.adjoint_albedo(theta_o)[c]));
  }
}

}  // namespace
}  // namespace weft::render
