#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "shading/fibre_bcsdf.h"
#include "shading/gamma.h"
#include "tests/shading_fibres.h"
#include "tests/shading_gamma_vectors.h"
#include "tests/shading_vectors.h"

namespace weft::shading {
namespace {

struct Lobes {
  double r;
  double tt;
};

Lobes gamma_lobes(const FibreBcsdf& bcsdf, const vectors::Gamma& v, int method) {
  const SphericalGaussian sg{fibre_direction(v.theta_p, v.phi_p + 0.3),
                             static_cast<float>(v.lambda)};
  const vec3 omega_o = fibre_direction(v.theta_o, 0.3);
  const FibreAngle o = fibre_angle(omega_o);
  const GammaLight light = gamma_light(sg, omega_o, o);
  return {gamma_lobe(bcsdf.lobes(), light, o.theta, false, method).x,
          gamma_lobe(bcsdf.lobes(), light, o.theta, true, method).x};
}

// Rounding of the directions to float: 1e-7 rad times the steepness of the product Gaussian in
// theta and of the azimuth, and 4e-5 of the tables.
double float_tolerance(const vectors::Gamma& v, double beta, double gamma) {
  const double b = 1 / (beta * beta);
  const double d = std::abs(v.theta_p + v.theta_o);
  return 1e-4 + 1e-6 * (b * v.lambda / (b + v.lambda) * d + 1 / (gamma * gamma));
}

TEST(Gamma, ClosedFormMatchesTheReference) {
  for (const auto& v : vectors::kGamma) {
    const vectors::Fibre& f = vectors::kFibres[v.fibre];
    const FibreBcsdf& bcsdf = published(v.fibre);
    const Lobes g = gamma_lobes(bcsdf, v, kGammaClosed);
    EXPECT_NEAR(g.r, v.r_closed, float_tolerance(v, f.beta_r, 1) * v.r_closed + 1e-11);
    EXPECT_NEAR(g.tt, v.tt_closed, float_tolerance(v, f.beta_tt, f.gamma_tt) * v.tt_closed + 1e-11);
  }
}

TEST(Gamma, Gl12MatchesTheReferenceAndTheExactIntegral) {
  for (const auto& v : vectors::kGamma) {
    const vectors::Fibre& f = vectors::kFibres[v.fibre];
    const FibreBcsdf& bcsdf = published(v.fibre);
    const Lobes g = gamma_lobes(bcsdf, v, kGammaGl12);
    EXPECT_NEAR(g.r, v.r_gl12, float_tolerance(v, f.beta_r, 1) * v.r_gl12 + 1e-11);
    EXPECT_NEAR(g.tt, v.tt_gl12, float_tolerance(v, f.beta_tt, f.gamma_tt) * v.tt_gl12 + 1e-11);
    EXPECT_NEAR(g.r, v.r_exact, 2e-3 * v.r_exact + 1e-9);
    EXPECT_NEAR(g.tt, v.tt_exact, 2e-3 * v.tt_exact + 1e-9);
  }
}

TEST(Gamma, HybridIsOneOfTheTwo) {
  int closed = 0;
  int gl12 = 0;
  for (const auto& v : vectors::kGamma) {
    const FibreBcsdf& bcsdf = published(v.fibre);
    const Lobes a = gamma_lobes(bcsdf, v, kGammaHybrid);
    const Lobes b = gamma_lobes(bcsdf, v, kGammaClosed);
    const Lobes c = gamma_lobes(bcsdf, v, kGammaGl12);
    EXPECT_TRUE(a.r == b.r || a.r == c.r);
    closed += a.r == b.r && b.r != c.r ? 1 : 0;
    gl12 += a.r == c.r && b.r != c.r ? 1 : 0;
  }
  EXPECT_GT(closed, 0);
  EXPECT_GT(gl12, 0);
}

TEST(Gamma, TendsToSTimesCosineAsTheLightNarrows) {
  for (const auto& v : vectors::kDirectionalLimit) {
    const FibreBcsdf& bcsdf = published(v.fibre);
    const vec3 xi = fibre_direction(v.theta_p, v.phi_p);
    const vec3 omega_o = fibre_direction(v.theta_o, 0);
    EXPECT_NEAR(bcsdf.evaluate_cos(xi, omega_o).x, v.s_cos, 1e-4 * v.s_cos);
    const float lambda = 1e5f;
    const double gamma = gamma_integral(bcsdf.lobes(), {xi, lambda}, omega_o, kGammaGl12).x;
    EXPECT_NEAR(gamma / sg_mass(lambda), v.s_cos, 3e-4 * v.s_cos);
  }
}

TEST(Gamma, OfAConstantLightIsTheAdjointAlbedo) {
  // lambda = 0 is light from everywhere. Within 4.5 widths lies all but 7e-6 of the lobe; the rest
  // is the rule's error for wide lobes.
  for (const vectors::Fibre& f : vectors::kFibres) {
    const FibreBcsdf bcsdf(grey_material(f));
    const vec3 o = fibre_direction(0.4, 0);
    const vec3 gamma = gamma_integral(bcsdf.lobes(), {{0, 0, 1}, 0}, o, kGammaGl12);
    EXPECT_NEAR(gamma.x, bcsdf.adjoint_albedo(0.4f).x, 2e-3) << f.name;
  }
}

// The same midpoint sum over the sphere that no step of the reduction goes into.
double brute_gamma(const FibreBcsdf& bcsdf, const SphericalGaussian& sg, vec3 omega_o) {
  constexpr int kRows = 900;
  constexpr int kColumns = 180;
  double sum = 0;
  for (int row = 0; row < kRows; ++row) {
    const double theta = std::numbers::pi * ((row + 0.5) / kRows - 0.5);
    for (int column = 0; column < kColumns; ++column) {
      const vec3 w = fibre_direction(theta, 2 * std::numbers::pi * column / kColumns);
      const float g = sg_evaluate(sg, w);
      if (g > 1e-9f) {
        sum += g * bcsdf.evaluate(w, omega_o).y * std::cos(theta) * std::cos(theta);
      }
    }
  }
  return sum * std::numbers::pi / kRows * 2 * std::numbers::pi / kColumns;
}

TEST(Gamma, IsTheIntegralOverTheSphere) {
  FibreMaterial m = grey_material(vectors::kGabardineR);
  m.c_r = {0.1f, 0.3f, 0.6f};
  m.c_tt = {0.9f, 0.5f, 0.2f};
  const FibreBcsdf bcsdf(m);
  const vec3 omega_o = fibre_direction(0.9, -1);
  for (const double theta : {-1.0, -0.8, 0.2}) {
    const SphericalGaussian sg{fibre_direction(theta, 1.9), 100};
    const double brute = brute_gamma(bcsdf, sg, omega_o);
    EXPECT_NEAR(gamma_integral(bcsdf.lobes(), sg, omega_o, kGammaGl12).y, brute,
                1e-3 * brute + 1e-7)
        << theta;
  }
}

void expect_finite_gamma(const FibreBcsdf& bcsdf, const SphericalGaussian& sg, vec3 omega_o) {
  for (const int method : {kGammaClosed, kGammaGl12, kGammaHybrid}) {
    const float g = gamma_integral(bcsdf.lobes(), sg, omega_o, method).x;
    EXPECT_TRUE(std::isfinite(g) && g >= 0) << g << " at sharpness " << sg.sharpness;
  }
}

TEST(Gamma, HoldsAtTheFibresAxis) {
  const FibreBcsdf bcsdf(grey_material(vectors::kSilkR));
  const std::array<vec3, 4> directions{vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0),
                                       fibre_direction(std::numbers::pi / 2, 1)};
  for (const vec3 xi : directions) {
    for (const vec3 o : directions) {
      for (const float lambda : {0.0f, 1e-6f, 1.0f, 1e3f, 1e6f}) {
        expect_finite_gamma(bcsdf, {xi, lambda}, o);
      }
    }
  }
}

}  // namespace
}  // namespace weft::shading
