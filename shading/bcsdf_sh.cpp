#include "shading/bcsdf_sh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "shading/lobe_normalisation.h"
#include "shading/quadrature.h"

namespace weft::shading {
namespace {

constexpr double kHalfPiExact = std::numbers::pi / 2;

using ShDouble = std::array<double, kShMaxCount>;

// The harmonics of spherical_harmonics.h in double precision: K_l^m Q_l^m(z) (x + i y)^m.
ShDouble evaluate_sh(double x, double y, double z) {
  ShDouble out{};
  double c = 1;
  double s = 0;
  double diagonal = std::sqrt(1 / (4 * std::numbers::pi));  // K_m^m Q_m^m
  for (int m = 0; m <= kShMaxOrder; ++m) {
    if (m > 0) {
      const double next = x * c - y * s;
      s = x * s + y * c;
      c = next;
      diagonal *= std::sqrt((2 * m + 1) / (2.0 * m));
    }
    double before = 0;
    double value = diagonal;
    for (int l = m; l <= kShMaxOrder; ++l) {
      if (l > m) {
        // Normalised recurrence of the associated Legendre functions.
        const double l2 = l * l;
        const double m2 = m * m;
        const double a = std::sqrt((4 * l2 - 1) / (l2 - m2));
        const double b = std::sqrt(((l - 1.0) * (l - 1.0) - m2) / (4 * (l - 1.0) * (l - 1.0) - 1));
        const double next = a * (z * value - b * before);
        before = value;
        value = next;
      }
      const auto order = static_cast<std::size_t>(l);
      const auto step = static_cast<std::size_t>(m);
      const std::size_t j = order * (order + 1);
      if (m == 0) {
        out[j] = value;
      } else {
        out[j + step] = std::numbers::sqrt2 * value * c;
        out[j - step] = std::numbers::sqrt2 * value * s;
      }
    }
  }
  return out;
}

// Integrals over the sphere of Y_j M_beta cos^2 and an azimuthal density, without and with the
// Schlick weight: the material's colours come in linearly afterwards.
struct LobeSh {
  ShDouble plain{};
  ShDouble schlick{};
};

// Points around the fibre, and weights by which their sum is the mean over an azimuthal density of
// what harmonics are there: a trigonometric polynomial of order kShMaxOrder.
constexpr std::size_t kAzimuths = 2 * kShMaxOrder + 2;
using AzimuthWeights = std::array<double, kAzimuths>;

double azimuth(std::size_t k, std::size_t count) {
  return 2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(count);
}

// Of the density exp(-kappa (1 + cos phi)), normalised; kappa = 0 is the uniform one of reflection.
AzimuthWeights azimuth_weights(double kappa) {
  const double gamma = kappa > 0 ? 1 / std::sqrt(kappa) : 1e9;
  const int least = 2 * (kShMaxOrder + static_cast<int>(std::ceil(8 / gamma)));
  const auto count = static_cast<std::size_t>(std::max(32, least));
  // Its mean cosines of m phi, by the trapezoid rule, which is exact for a periodic function.
  std::array<double, kShMaxOrder + 1> cosines{};
  for (std::size_t k = 0; k < count; ++k) {
    const double phi = azimuth(k, count);
    const double density = std::exp(-kappa * (1 + std::cos(phi)));
    for (std::size_t m = 0; m < cosines.size(); ++m) {
      cosines[m] += density * std::cos(static_cast<double>(m) * phi);
    }
  }
  AzimuthWeights weights{};
  for (std::size_t k = 0; k < kAzimuths; ++k) {
    weights[k] = 1.0 / kAzimuths;
    for (std::size_t m = 1; m < cosines.size(); ++m) {
      weights[k] += 2.0 / kAzimuths * cosines[m] / cosines[0] *
                    std::cos(static_cast<double>(m) * azimuth(k, kAzimuths));
    }
  }
  return weights;
}

LobeSh lobe_sh(double theta_o, const LobeNormalisation& norm, const AzimuthWeights& azimuths) {
  const double beta = norm.beta();
  static const QuadratureRule rule = gauss_legendre(48);
  const double low = std::max(-kHalfPiExact, -theta_o - 9 * beta);
  const double high = std::min(kHalfPiExact, -theta_o + 9 * beta);
  LobeSh sum;
  for (std::size_t n = 0; n < rule.nodes.size(); ++n) {
    const double theta = 0.5 * (low + high) + 0.5 * (high - low) * rule.nodes[n];
    const double c = std::cos(theta);
    const double d = (theta + theta_o) / beta;
    const double m =
        std::exp(-0.5 * d * d) / (std::sqrt(2 * std::numbers::pi) * beta) / norm(theta);
    const double weight = rule.weights[n] * 0.5 * (high - low) * m * c * c;
    const double schlick = weight * std::pow(1 - c, 5);
    for (std::size_t k = 0; k < kAzimuths; ++k) {
      const double phi = azimuth(k, kAzimuths);
      const ShDouble y = evaluate_sh(std::sin(theta), c * std::cos(phi), c * std::sin(phi));
      for (std::size_t j = 0; j < y.size(); ++j) {
        sum.plain[j] += y[j] * weight * azimuths[k];
        sum.schlick[j] += y[j] * schlick * azimuths[k];
      }
    }
  }
  return sum;
}

// Whether Y_j(-x, y, z) = -Y_j(x, y, z): cos(m phi) for odd m, sin(m phi) for even m.
bool odd_in_x(std::size_t j) {
  const auto l = static_cast<int>(std::sqrt(static_cast<double>(j)));
  const int m = static_cast<int>(j) - l * (l + 1);
  return m > 0 ? m % 2 == 1 : m < 0 && m % 2 == 0;
}

// What bcsdf_sh() needs of a material for any angle.
struct Lobes {
  explicit Lobes(const FibreMaterial& material)
      : r(material.beta_r),
        tt(material.beta_tt),
        azimuths_r(azimuth_weights(0)),
        azimuths_tt(
            azimuth_weights(1 / (static_cast<double>(material.gamma_tt) * material.gamma_tt))) {}
  LobeNormalisation r;
  LobeNormalisation tt;
  AzimuthWeights azimuths_r;
  AzimuthWeights azimuths_tt;
};

BcsdfSh bcsdf_sh(const FibreMaterial& material, const Lobes& lobes, double theta_o) {
  const LobeSh r = lobe_sh(theta_o, lobes.r, lobes.azimuths_r);
  const LobeSh tt = lobe_sh(theta_o, lobes.tt, lobes.azimuths_tt);
  BcsdfSh out;
  for (int channel = 0; channel < 3; ++channel) {
    const double c_r = material.c_r[channel];
    const double c_tt = material.c_tt[channel];
    auto& c = out[static_cast<std::size_t>(channel)];
    for (std::size_t j = 0; j < c.size(); ++j) {
      // F = C_R + (1 - C_R) schlick, 1 - F = (1 - C_R)(1 - schlick).
      c[j] = c_r * r.plain[j] + (1 - c_r) * r.schlick[j] +
             c_tt * (1 - c_r) * (tt.plain[j] - tt.schlick[j]);
    }
  }
  return out;
}

}  // namespace

BcsdfSh bcsdf_sh(const FibreMaterial& material, double theta_o) {
  return bcsdf_sh(material, Lobes(material), theta_o);
}

std::vector<float> bcsdf_sh_table(const FibreMaterial& material, int order) {
  const std::size_t side = static_cast<std::size_t>(order) + 1;
  const std::size_t count = side * side;
  const Lobes lobes(material);
  std::vector<float> table(std::size_t{3} * kBcsdfShAngles * count);
  // Only half of the angles: mirroring the fibre in x turns theta_o into -theta_o.
  for (std::size_t i = 0; i < kBcsdfShAngles / 2; ++i) {
    const double theta_o =
        -kHalfPiExact + std::numbers::pi * static_cast<double>(i) / (kBcsdfShAngles - 1);
    const std::size_t mirrored = kBcsdfShAngles - 1 - i;
    const BcsdfSh c = bcsdf_sh(material, lobes, theta_o);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t j = 0; j < count; ++j) {
        const auto value = static_cast<float>(c[channel][j]);
        table[(channel * kBcsdfShAngles + i) * count + j] = value;
        table[(channel * kBcsdfShAngles + mirrored) * count + j] = odd_in_x(j) ? -value : value;
      }
    }
  }
  return table;
}

}  // namespace weft::shading
