#include "coordinator/versions/sky_extension.h"

#include <array>
#include <cmath>
#include <numbers>

#include <glm/vec3.hpp>

#include "core/check.h"
#include "shading/quadrature.h"
#include "shading/scattering_orders.h"
#include "shading/spherical_harmonics.h"

namespace weft::coordinator {

namespace {

constexpr std::size_t kLow = (shading::kShapeOrder + 1) * (shading::kShapeOrder + 1);
using Products = std::array<std::array<double, kLow>, shading::kShMaxCount>;

// Integrals over the upper hemisphere of the products of harmonics: [all, low].
Products products_above() {
  constexpr int kAzimuths = 16;  // more than twice the order: exact
  const shading::QuadratureRule rule = shading::gauss_legendre(8);
  Products products{};
  for (std::size_t n = 0; n < rule.nodes.size(); ++n) {
    const double z = 0.5 * (rule.nodes[n] + 1);
    const double r = std::sqrt(1 - z * z);
    for (int k = 0; k < kAzimuths; ++k) {
      const double phi = 2 * std::numbers::pi * k / kAzimuths;
      const shading::ShVector y =
          shading::sh_evaluate(glm::vec3(glm::dvec3(r * std::cos(phi), r * std::sin(phi), z)));
      for (std::size_t i = 0; i < shading::kShMaxCount; ++i) {
        for (std::size_t j = 0; j < kLow; ++j) {
          products[i][j] += 0.5 * rule.weights[n] * 2 * std::numbers::pi / kAzimuths *
                            static_cast<double>(y.c[i]) * static_cast<double>(y.c[j]);
        }
      }
    }
  }
  return products;
}

// Solves a x = b in place of b for a symmetric positive definite matrix, by Cholesky.
void solve(std::array<std::array<double, kLow>, kLow> a, std::array<double, kLow>& b) {
  for (std::size_t j = 0; j < kLow; ++j) {
    for (std::size_t k = 0; k < j; ++k) {
      a[j][j] -= a[j][k] * a[j][k];
    }
    CHECK_GT(a[j][j], 0);
    a[j][j] = std::sqrt(a[j][j]);
    for (std::size_t i = j + 1; i < kLow; ++i) {
      for (std::size_t k = 0; k < j; ++k) {
        a[i][j] -= a[i][k] * a[j][k];
      }
      a[i][j] /= a[j][j];
    }
  }
  for (std::size_t i = 0; i < kLow; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      b[i] -= a[i][k] * b[k];
    }
    b[i] /= a[i][i];
  }
  for (std::size_t i = kLow; i-- > 0;) {
    for (std::size_t k = i + 1; k < kLow; ++k) {
      b[i] -= a[k][i] * b[k];
    }
    b[i] /= a[i][i];
  }
}

}  // namespace

// By ridge regression: with G the products, p = (G^T G + r^2)^-1 G^T x for low harmonics x.
std::vector<double> sky_extension(std::size_t sh_order) {
  // Less follows the harmonics of smooth light nearer, and lets more of their noise through.
  constexpr double kRidge = 3e-3;
  CHECK_LE(sh_order, static_cast<std::size_t>(shading::kShMaxOrder));
  const Products products = products_above();
  std::array<std::array<double, kLow>, kLow> normal{};
  for (std::size_t i = 0; i < kLow; ++i) {
    for (std::size_t j = 0; j < kLow; ++j) {
      for (std::size_t k = 0; k < kLow; ++k) {
        normal[i][j] += products[k][i] * products[k][j];
      }
    }
    normal[i][i] += kRidge * kRidge;
  }
  const std::size_t all = (sh_order + 1) * (sh_order + 1);
  std::vector<double> extension;
  for (std::size_t high = kLow; high < all; ++high) {
    // A row is G_high (G^T G + r^2)^-1 G^T, and the matrix in the middle is symmetric.
    std::array<double, kLow> row = products[high];
    solve(normal, row);
    for (std::size_t low = 0; low < kLow; ++low) {
      double value = 0;
      for (std::size_t k = 0; k < kLow; ++k) {
        value += row[k] * products[low][k];
      }
      extension.push_back(value);
    }
  }
  return extension;
}

}  // namespace weft::coordinator
