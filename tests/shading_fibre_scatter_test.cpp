#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "core/random.h"
#include "shading/fibre_bcsdf.h"
#include "shading/spherical_harmonics.h"
#include "tests/shading_fibres.h"

namespace weft::shading {
namespace {

constexpr std::uint64_t kSeed = 20170418;

glm::vec3 three_numbers(core::Random& random) {
  const float a = random.uniform();
  const float b = random.uniform();
  return {a, b, random.uniform()};
}

// The silk of Khungurn et al. 2015: reflection red, transmission grey.
FibreMaterial red_and_grey() {
  FibreMaterial m;
  m.c_r = {0.745f, 0.008f, 0.07f};
  m.c_tt = {0.62f, 0.553f, 0.562f};
  m.beta_r = 0.0175f;
  m.beta_tt = 0.1745f;
  m.gamma_tt = 0.346f;
  return m;
}

const FibreBcsdf& coloured() {
  static const FibreBcsdf made(red_and_grey());
  return made;
}

// A mean and its standard error.
struct Average {
  double sum = 0;
  double squares = 0;
  double count = 0;
  void add(double value) {
    sum += value;
    squares += value * value;
    count += 1;
  }
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double error() const {
    return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count);
  }
};

// Throughput times harmonics of the direction, channel by channel, summed over what survives.
constexpr std::size_t kHarmonics = 9;
using Moments = std::array<Average, 3 * kHarmonics>;
using Sums = std::array<double, 3 * kHarmonics>;

void add(glm::vec3 omega_i, glm::vec3 throughput, Sums& sums) {
  const ShVector y = sh_evaluate(omega_i);
  for (std::size_t j = 0; j < kHarmonics; ++j) {
    for (int c = 0; c < 3; ++c) {
      sums[3 * j + static_cast<std::size_t>(c)] += static_cast<double>(throughput[c] * y.c[j]);
    }
  }
}

void add(const Sums& sums, Moments& moments) {
  for (std::size_t k = 0; k < sums.size(); ++k) {
    moments[k].add(sums[k]);
  }
}

void expect_equal(const Moments& a, const Moments& b) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    // Two-sided 0.01 over 36 cases of 27 numbers (Sidak): 4.4; tables and floats: 1e-4.
    EXPECT_NEAR(a[k].mean(), b[k].mean(), 4.4 * std::hypot(a[k].error(), b[k].error()) + 1e-4) << k;
  }
}

class FibreScatter : public testing::TestWithParam<std::tuple<std::size_t, double>> {
 protected:
  static constexpr std::uint64_t kSamples = 50000;

  [[nodiscard]] const FibreBcsdf& bcsdf() const {
    const std::size_t material = std::get<0>(GetParam());
    return material < 4 ? published(material) : coloured();
  }
  [[nodiscard]] glm::vec3 omega_o() const { return fibre_direction(std::get<1>(GetParam()), 0.3); }

  // What sample() says, which knows nothing of odds.
  [[nodiscard]] Moments plain(glm::vec3 throughput) const {
    Moments moments;
    for (std::uint64_t n = 0; n < kSamples; ++n) {
      core::Random random(kSeed, 1, n);
      const glm::vec3 u = three_numbers(random);
      const BcsdfSample s = bcsdf().sample(omega_o(), u.x, u.y, u.z);
      Sums sums{};
      add(s.omega_i, throughput * s.weight, sums);
      add(sums, moments);
    }
    return moments;
  }
};

TEST_P(FibreScatter, HasTheExpectationOfPlainSamples) {
  const glm::vec3 throughput(0.9f, 0.3f, 0.6f);
  const LobeOdds odds = bcsdf().odds(omega_o(), throughput);
  ASSERT_LE(odds.r + odds.tt, 1.2f);
  Moments moments;
  for (std::uint64_t n = 0; n < kSamples; ++n) {
    core::Random random(kSeed, 2, n);
    glm::vec3 u = three_numbers(random);
    Sums sums{};
    for (; u.x < odds.r + odds.tt; u.x += 1) {
      const BcsdfStep step = bcsdf().scatter(omega_o(), odds, throughput, u);
      ASSERT_TRUE(step.survives);
      ASSERT_NEAR(glm::length(step.omega_i), 1, 1e-6);
      add(step.omega_i, step.throughput, sums);
    }
    add(sums, moments);
  }
  expect_equal(moments, plain(throughput));
}

TEST_P(FibreScatter, HasItForOtherOddsToo) {
  const glm::vec3 throughput(0.9f, 0.3f, 0.6f);
  LobeOdds odds = bcsdf().odds(omega_o(), throughput);
  odds.r = 0.3f;
  odds.tt = 0.5f;
  Moments moments;
  for (std::uint64_t n = 0; n < kSamples; ++n) {
    core::Random random(kSeed, 3, n);
    const BcsdfStep step = bcsdf().scatter(omega_o(), odds, throughput, three_numbers(random));
    Sums sums{};
    if (step.survives) {
      add(step.omega_i, step.throughput, sums);
    }
    add(sums, moments);
  }
  expect_equal(moments, plain(throughput));
}

// Each lobe's weight is its S cos over the density in which it is drawn.
TEST_P(FibreScatter, DrawsFromTheDensitiesOfItsLobes) {
  const glm::vec3 throughput(0.9f, 0.3f, 0.6f);
  const LobeOdds odds = bcsdf().odds(omega_o(), throughput).at_most(1);
  for (std::uint64_t n = 0; n < 2000; ++n) {
    core::Random random(kSeed, 6, n);
    const glm::vec3 u = three_numbers(random);
    const BcsdfStep step = bcsdf().scatter(omega_o(), odds, throughput, u);
    if (!step.survives) {
      continue;
    }
    const bool reflects = u.x < odds.r;
    const LobeDensities lobes = bcsdf().densities(step.omega_i, omega_o(), odds);
    const glm::vec3 scattered = reflects ? lobes.r : lobes.tt;
    const float pdf = reflects ? odds.r * lobes.pdf_r : odds.tt * lobes.pdf_tt;
    for (int c = 0; c < 3; ++c) {
      // Directions are floats, whose rounding steep lobes and the axis make large.
      EXPECT_NEAR(pdf * step.throughput[c], throughput[c] * scattered[c],
                  2e-3f * throughput[c] * scattered[c] + 1e-6f);
    }
  }
}

TEST_P(FibreScatter, LobesAddUpToTheWhole) {
  const LobeOdds odds = bcsdf().odds(omega_o(), glm::vec3(1));
  for (std::uint64_t n = 0; n < 2000; ++n) {
    core::Random random(kSeed, 7, n);
    const glm::vec3 u = three_numbers(random);
    const BcsdfSample drawn = bcsdf().sample(omega_o(), u.x, u.y, u.z);
    const LobeDensities lobes = bcsdf().densities(drawn.omega_i, omega_o(), odds);
    const glm::vec3 whole = bcsdf().evaluate_cos(drawn.omega_i, omega_o());
    const float pdf = bcsdf().pdf(drawn.omega_i, omega_o());
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(lobes.r[c] + lobes.tt[c], whole[c], 1e-5f * whole[c]);
    }
    // sample() picks the lobes by shares that sum to one.
    EXPECT_LE(std::min(lobes.pdf_r, lobes.pdf_tt), 1.0001f * pdf);
    EXPECT_GE(std::max(lobes.pdf_r, lobes.pdf_tt), 0.9999f * pdf);
  }
}

INSTANTIATE_TEST_SUITE_P(PublishedMaterials, FibreScatter,
                         testing::Combine(testing::Values(0, 1, 2, 3, 4),
                                          testing::Values(0.0, -1.0, 1.35, -1.5707963)));

// Many scatterings one after the other, at longitudes that change as from fibre to fibre: the
// second moment of what survives stays small, while that of plain samples has no bound.
TEST(FibreScatter, ThroughputsDoNotGrow) {
  const FibreBcsdf& bcsdf = coloured();
  constexpr std::uint64_t kPaths = 20000;
  double squares = 0;
  for (std::uint64_t n = 0; n < kPaths; ++n) {
    core::Random random(kSeed, 4, n);
    glm::vec3 throughput(1);
    for (int scattering = 0; scattering < 12; ++scattering) {
      const glm::vec3 omega_o = fibre_direction(2 * random.uniform() - 1, 0);
      LobeOdds odds = bcsdf.odds(omega_o, throughput);
      const float sum = std::max(1.0f, odds.r + odds.tt);
      odds.r /= sum;
      odds.tt /= sum;
      const BcsdfStep step = bcsdf.scatter(omega_o, odds, throughput, three_numbers(random));
      throughput = step.survives ? step.throughput : glm::vec3(0);
      ASSERT_LT(std::max({throughput.x, throughput.y, throughput.z}), 2.5f);
    }
    squares += static_cast<double>(glm::dot(throughput, throughput)) / kPaths;
  }
  EXPECT_LT(squares, 1);
  EXPECT_GT(squares, 1e-3);
}

TEST(FibreScatter, IsSoundAtTheCornersOfItsNumbers) {
  constexpr std::array<float, 4> kCorners{0.0f, 0x1p-24f, 0.5f, 1.0f - 0x1p-24f};
  for (const double theta : {0.0, 1.5707, -1.5707963}) {
    const glm::vec3 omega_o = fibre_direction(theta, 0.3);
    const LobeOdds odds = coloured().odds(omega_o, glm::vec3(1));
    for (std::size_t n = 0; n < 64; ++n) {
      const BcsdfStep step = coloured().scatter(
          omega_o, odds, glm::vec3(1), {kCorners[n / 16], kCorners[n / 4 % 4], kCorners[n % 4]});
      if (step.survives) {
        EXPECT_NEAR(glm::length(step.omega_i), 1, 1e-6);
        EXPECT_GE(step.throughput.x, 0);
        EXPECT_LT(step.throughput.x, 4);
      }
    }
  }
}

TEST(FibreScatter, BlackFibresEndMostPaths) {
  FibreMaterial black = red_and_grey();
  black.c_r = {0, 0, 0};
  black.c_tt = {0, 0, 0};
  const LobeOdds odds = FibreBcsdf(black).odds(fibre_direction(0.2, 0), glm::vec3(1));
  EXPECT_LT(odds.r, 0.01f);
  EXPECT_EQ(odds.tt, 0);
}

TEST(FibreScatter, FurnaceTransmitsByItsDensity) {
  const FibreBcsdf furnace = FibreBcsdf::furnace();
  const glm::vec3 omega_o = fibre_direction(0.4, 1);
  const glm::vec3 omega_i = fibre_direction(-0.9, 2);
  const LobeDensities lobes =
      furnace.densities(omega_i, omega_o, furnace.odds(omega_o, glm::vec3(1)));
  EXPECT_EQ(lobes.r, glm::vec3(0));
  EXPECT_EQ(lobes.pdf_r, 0);
  EXPECT_FLOAT_EQ(lobes.tt.x, furnace.evaluate_cos(omega_i, omega_o).x);
  EXPECT_FLOAT_EQ(lobes.pdf_tt, furnace.pdf(omega_i, omega_o));
}

TEST(FibreScatter, FurnaceKeepsTheThroughputAtOne) {
  const FibreBcsdf furnace = FibreBcsdf::furnace();
  const glm::vec3 omega_o = fibre_direction(0.4, 1);
  const LobeOdds odds = furnace.odds(omega_o, glm::vec3(0.5f));
  std::uint64_t survivors = 0;
  for (std::uint64_t n = 0; n < 4096; ++n) {
    core::Random random(kSeed, 5, n);
    const BcsdfStep step = furnace.scatter(omega_o, odds, glm::vec3(0.5f), three_numbers(random));
    if (step.survives) {
      ++survivors;
      ASSERT_EQ(step.throughput, glm::vec3(1));
    }
  }
  EXPECT_NEAR(static_cast<double>(survivors), 2048, 2.6 * 32);
}

}  // namespace
}  // namespace weft::shading
