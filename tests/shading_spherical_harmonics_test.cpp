#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include <gtest/gtest.h>

#include "core/random.h"
#include "shading/bcsdf_sh.h"
#include "shading/fibre_bcsdf.h"
#include "shading/quadrature.h"
#include "shading/sh_rotation.h"
#include "shading/spherical_harmonics.h"
#include "tests/shading_fibres.h"
#include "tests/shading_sh_vectors.h"
#include "tests/shading_vectors.h"

namespace weft::shading {
namespace {

vec3 to_vec3(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

ShVector to_sh(const std::array<double, 36>& v) {
  ShVector r{};
  for (std::size_t j = 0; j < v.size(); ++j) {
    r.c[j] = static_cast<float>(v[j]);
  }
  return r;
}

mat3 from_rows(vec3 a, vec3 b, vec3 c) { return glm::transpose(mat3(a, b, c)); }

mat3 random_rotation(std::uint32_t stream) {
  core::Random random(7, stream);
  const auto unit = [&] {
    return normalize(
        vec3(random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f));
  };
  const vec3 x = unit();
  const vec3 y = normalize(cross(x, unit()));
  return from_rows(x, y, cross(x, y));
}

TEST(SphericalHarmonics, HaveTheReferenceValues) {
  for (const auto& v : vectors::kShValues) {
    const ShVector y = sh_evaluate(to_vec3(v.direction));
    for (std::size_t j = 0; j < 36; ++j) {
      EXPECT_NEAR(y.c[j], v.values[j], 2e-6) << j;  // float
    }
  }
}

using Gram = std::array<std::array<double, 36>, 36>;

void add_outer_product(Gram& gram, vec3 direction, double weight) {
  const ShVector y = sh_evaluate(direction);
  for (std::size_t a = 0; a < 36; ++a) {
    for (std::size_t b = 0; b < 36; ++b) {
      gram[a][b] += weight * y.c[a] * y.c[b];
    }
  }
}

TEST(SphericalHarmonics, AreOrthonormal) {
  const QuadratureRule rule = gauss_legendre(12);
  Gram gram{};
  constexpr int kColumns = 24;
  for (std::size_t n = 0; n < rule.nodes.size(); ++n) {
    const double z = rule.nodes[n];
    const double s = std::sqrt(1 - z * z);
    for (int k = 0; k < kColumns; ++k) {
      const double phi = 2 * std::numbers::pi * k / kColumns;
      const vec3 w(static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
                   static_cast<float>(z));
      add_outer_product(gram, w, rule.weights[n] * 2 * std::numbers::pi / kColumns);
    }
  }
  for (std::size_t k = 0; k < std::size_t{36} * 36; ++k) {
    EXPECT_NEAR(gram[k / 36][k % 36], k / 36 == k % 36 ? 1 : 0, 3e-6) << k;
  }
}

TEST(SphericalHarmonics, RotationMatchesTheReference) {
  const mat3 r = from_rows(to_vec3(vectors::kRotation[0]), to_vec3(vectors::kRotation[1]),
                           to_vec3(vectors::kRotation[2]));
  const ShVector out = sh_rotate(sh_rotation(r), to_sh(vectors::kRotationIn));
  for (std::size_t j = 0; j < 36; ++j) {
    EXPECT_NEAR(out.c[j], vectors::kRotationOut[j], 3e-6) << j;
  }
  for (std::size_t n = 0; n < 3; ++n) {
    ShVector unit = sh_zero();
    unit.c[1 + n] = 1;
    const ShVector column = sh_rotate(sh_rotation(r), unit);
    for (std::size_t m = 0; m < 3; ++m) {
      EXPECT_NEAR(column.c[1 + m], vectors::kRotationBand1[m][n], 1e-6);
    }
  }
  for (std::size_t n = 0; n < 5; ++n) {
    ShVector unit = sh_zero();
    unit.c[4 + n] = 1;
    const ShVector column = sh_rotate(sh_rotation(r), unit);
    for (std::size_t m = 0; m < 5; ++m) {
      EXPECT_NEAR(column.c[4 + m], vectors::kRotationBand2[m][n], 1e-6);
    }
  }
}

// Y(R w) = D(R) Y(w), also where the Euler angles degenerate.
TEST(SphericalHarmonics, RotatingCoefficientsIsRotatingTheArgument) {
  std::vector<mat3> rotations{mat3(1),
                              from_rows({1, 0, 0}, {0, -1, 0}, {0, 0, -1}),
                              from_rows({-1, 0, 0}, {0, 1, 0}, {0, 0, -1}),
                              from_rows({0, -1, 0}, {1, 0, 0}, {0, 0, 1}),
                              from_rows({0, 0, 1}, {1, 0, 0}, {0, 1, 0}),
                              from_rows({0, 1, 0}, {1, 0, 0}, {0, 0, -1}),
                              from_rows({1, 0, 0}, {0, 1, 1e-7f}, {0, -1e-7f, 1})};
  for (std::uint32_t k = 0; k < 40; ++k) {
    rotations.push_back(random_rotation(k));
  }
  for (const mat3& r : rotations) {
    for (const vec3 w : {normalize(vec3(0.3f, -0.5f, 0.7f)), vec3(0, 0, 1), vec3(-1, 0, 0)}) {
      const ShVector direct = sh_evaluate(r * w);
      const ShVector turned = sh_rotate(sh_rotation(r), sh_evaluate(w));
      for (std::size_t j = 0; j < 36; ++j) {
        ASSERT_NEAR(turned.c[j], direct.c[j], 1e-5) << j;
      }
    }
  }
}

TEST(SphericalHarmonics, ZonalCoefficientsOfGaussiansMatchTheReference) {
  for (const auto& v : vectors::kZonalSg) {
    const ShZonal z = sg_zonal(static_cast<float>(v.lambda));
    for (std::size_t l = 0; l < 6; ++l) {
      EXPECT_NEAR(z.a[l], v.a[l], 3e-6 * v.a[l]) << v.lambda << " " << l;
    }
  }
}

TEST(SphericalHarmonics, ZonalCoefficientsAreStableForEverySharpness) {
  // A_l = integral of G P_l / M, by quadrature in t = lambda (1 - z).
  const QuadratureRule rule = gauss_legendre(200);
  for (double lambda = 1e-6; lambda < 2e4; lambda *= 3.3) {
    const double top = std::min(2 * lambda, 60.0);
    std::array<double, 6> sum{};
    double mass = 0;
    for (std::size_t n = 0; n < rule.nodes.size(); ++n) {
      const double t = 0.5 * top * (1 + rule.nodes[n]);
      const double z = 1 - t / lambda;
      const double w = rule.weights[n] * std::exp(-t);
      mass += w;
      for (unsigned l = 0; l < 6; ++l) {
        sum[l] += w * std::legendre(l, z);
      }
    }
    const ShZonal z = sg_zonal(static_cast<float>(lambda));
    for (std::size_t l = 0; l < 6; ++l) {
      EXPECT_NEAR(z.a[l], sum[l] / mass, 3e-6) << lambda << " " << l;
    }
  }
  const ShZonal flat = sg_zonal(0);
  EXPECT_EQ(flat.a[0], 1);
  EXPECT_EQ(flat.a[1], 0);
  EXPECT_EQ(flat.a[5], 0);
}

TEST(SphericalHarmonics, ZonalFunctionTurnsAboutAnyAxis) {
  const ShVector c = sh_zonal_about(sg_zonal(static_cast<float>(vectors::kRotatedSgLambda)),
                                    to_vec3(vectors::kRotatedSgAxis));
  for (std::size_t j = 0; j < 36; ++j) {
    EXPECT_NEAR(c.c[j], vectors::kRotatedSg[j], 2e-6) << j;
  }
}

TEST(BcsdfSh, MatchesTheReference) {
  for (const auto& v : vectors::kShBcsdf) {
    FibreMaterial m = grey_material(vectors::kFibres[v.fibre]);
    const BcsdfSh c = bcsdf_sh(m, v.theta_o);
    for (std::size_t j = 0; j < 36; ++j) {
      // The widths are floats in FibreMaterial (relative 3e-8), the quadrature is exact to 1e-13.
      EXPECT_NEAR(c[1][j], v.coefficients[j], 3e-7) << vectors::kFibres[v.fibre].name << " " << j;
    }
  }
}

TEST(BcsdfSh, FirstCoefficientIsTheAdjointAlbedo) {
  for (const vectors::Fibre& f : vectors::kFibres) {
    const FibreMaterial m = grey_material(f);
    const FibreBcsdf bcsdf(m);
    for (const double theta_o : {-1.5, -0.3, 0.8, 1.57}) {
      const double albedo = std::sqrt(4 * std::numbers::pi) * bcsdf_sh(m, theta_o)[0][0];
      EXPECT_NEAR(albedo, bcsdf.adjoint_albedo(static_cast<float>(theta_o)).x, 1e-4);
    }
  }
}

TEST(BcsdfSh, TableHoldsEveryAngleOfEveryChannel) {
  FibreMaterial m = grey_material(vectors::kFleeceG);
  m.c_tt = {0.2f, 0.5f, 0.9f};
  const int order = 2;
  const std::vector<float> table = bcsdf_sh_table(m, order);
  ASSERT_EQ(table.size(), 3u * kBcsdfShAngles * 9u);
  for (const std::size_t i :
       {std::size_t{0}, std::size_t{100}, std::size_t{300}, std::size_t{511}}) {
    const double theta_o = std::numbers::pi * (static_cast<double>(i) / 511 - 0.5);
    const BcsdfSh c = bcsdf_sh(m, theta_o);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t j = 0; j < 9; ++j) {
        const double value = c[channel][j];
        EXPECT_NEAR(table[(channel * kBcsdfShAngles + i) * 9 + j], value,
                    1e-7 * std::abs(value) + 1e-15);
      }
    }
  }
}

TEST(BcsdfSh, MultipleScatteringMatchesTheReferenceEndToEnd) {
  for (const auto& v : vectors::kMultiScatter) {
    const FibreMaterial m = grey_material(vectors::kFibres[v.fibre]);
    const mat3 frame = fibre_frame(to_vec3(v.tangent), to_vec3(v.omega_o));
    const FibreAngle o = fibre_angle(frame * to_vec3(v.omega_o));
    EXPECT_NEAR(o.theta, v.theta_o, 1e-6);
    const BcsdfSh c_s = bcsdf_sh(m, o.theta);
    const ShVector c_t = sh_rotate(sh_rotation(frame), to_sh(v.c_t));
    double sum = 0;
    for (std::size_t j = 0; j < 36; ++j) {
      sum += c_s[0][j] * c_t.c[j];
    }
    EXPECT_NEAR(sum, v.radiance, 1e-5);  // float rotation of coefficients of size one
  }
}

}  // namespace
}  // namespace weft::shading
