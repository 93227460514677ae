#include "render/baselines/dual_fibre.h"

#include <algorithm>
#include <cmath>

#include <glm/common.hpp>

#include "core/check.h"
#include "shading/gamma.h"

namespace weft::render {
namespace {

using shading::kHalfPi;
using shading::kPi;

constexpr int kAzimuths = 512;       // entries of the table of half circles, less one
constexpr int kAzimuthSteps = 8192;  // of the sums over a circle
constexpr float kReach = 4.5f;       // standard deviations that hold a Gaussian (as gamma.h)

float gaussian(float x, float variance) {
  return std::exp(-0.5f * x * x / variance) / std::sqrt(shading::kTwoPi * variance);
}

float mean(const glm::vec3& v) { return (v.x + v.y + v.z) / 3; }

// Twelve nodes over a Gaussian, cut at +-pi/2: the sum of f times the length each node stands for.
template <class F>
glm::vec3 over_gaussian(float centre, float variance, const F& f) {
  const float reach = kReach * std::sqrt(variance);
  const float low = std::max(-kHalfPi, centre - reach);
  const float high = std::min(kHalfPi, centre + reach);
  glm::vec3 sum(0);
  for (int k = 0; k < 12; ++k) {
    const shading::Gl12Node node = shading::gl12_node(k);
    sum += f(0.5f * (low + high) + 0.5f * (high - low) * node.x) * node.weight;
  }
  return sum * (0.5f * std::max(0.0f, high - low));
}

// G(mu; sigma), the integral of N(t; mu, sigma) cos^2 t: what makes a Gaussian in longitude a lobe
// of unit power.
float power_of_gaussian(float mu, float variance) {
  return over_gaussian(mu, variance,
                       [&](float t) {
                         const float c = std::cos(t);
                         return glm::vec3(gaussian(t - mu, variance) * c * c);
                       })
      .x;
}

}  // namespace

DualFibre::DualFibre(const shading::FibreBcsdf& bcsdf) : bcsdf_(bcsdf) {
  CHECK(!bcsdf.is_furnace());
  // The von Mises density of S_TT's azimuth about straight on, summed at even steps.
  const double kappa = 1 / std::pow(static_cast<double>(bcsdf.material().gamma_tt), 2);
  const double step = 2 * static_cast<double>(kPi) / kAzimuthSteps;
  std::vector<double> cumulative(kAzimuthSteps + 1, 0.0);  // up to -pi + i step
  double spread = 0;
  for (int i = 0; i < kAzimuthSteps; ++i) {
    const double v = -static_cast<double>(kPi) + (i + 0.5) * step;
    const double density = std::exp(-kappa * (1 - std::cos(v)));
    cumulative[static_cast<std::size_t>(i) + 1] = cumulative[static_cast<std::size_t>(i)] + density;
    spread += density * std::fabs(v);
  }
  const double total = cumulative.back();
  forward_share_ = static_cast<float>(1 - spread / total / static_cast<double>(kPi));
  // Of light spread over half a circle, the share that S_TT turns to an eye `straight` off it.
  constexpr int kHalf = kAzimuthSteps / 4;  // steps in pi / 2
  for (int i = 0; i <= kAzimuths; ++i) {
    const int centre = kAzimuthSteps / 2 + i * (kAzimuthSteps / 2) / kAzimuths;
    const int low = centre - kHalf;
    const int high = centre + kHalf;
    const auto at = [&](int n) { return cumulative[static_cast<std::size_t>(n)]; };
    const double inside =
        high <= kAzimuthSteps ? at(high) - at(low) : total - at(low) + at(high - kAzimuthSteps);
    transmitted_.push_back(static_cast<float>(inside / total / static_cast<double>(kPi)));
  }
}

float DualFibre::transmitted_azimuth(float straight) const {
  const float t = std::min(std::fabs(straight) / kPi, 1.0f) * kAzimuths;
  const int i = std::min(static_cast<int>(t), kAzimuths - 1);
  const auto k = static_cast<std::size_t>(i);
  return transmitted_[k] + (t - static_cast<float>(i)) * (transmitted_[k + 1] - transmitted_[k]);
}

DualFibre::Averages DualFibre::averages(float theta) const {
  const shading::FibreMaterial& material = bcsdf_.material();
  const glm::vec3 f = shading::fresnel(material.c_r, std::cos(theta));
  const glm::vec3 transmitted = (glm::vec3(1) - f) * material.c_tt;
  const float variance_r = material.beta_r * material.beta_r;
  const float variance_tt = material.beta_tt * material.beta_tt;
  Averages result;
  result.forward = 0.5f * f + forward_share_ * transmitted;
  result.backward = 0.5f * f + (1 - forward_share_) * transmitted;
  const auto mixture = [&](float share) {
    const float r = 0.5f * mean(f);
    const float tt = share * mean(transmitted);
    return r + tt > 0 ? (r * variance_r + tt * variance_tt) / (r + tt) : variance_r;
  };
  result.forward_variance = mixture(forward_share_);
  result.backward_variance = mixture(1 - forward_share_);
  return result;
}

glm::vec3 DualFibre::scattered(float theta_d, float theta_o, float straight, float variance) const {
  const shading::FibreMaterial& material = bcsdf_.material();
  const shading::FibreLobes& lobes = bcsdf_.lobes();
  const float power = power_of_gaussian(theta_d, variance);
  const auto lobe = [&](float beta, bool transmission) {
    const float narrow = beta * beta;
    const float centre = (theta_d * narrow - theta_o * variance) / (narrow + variance);
    return over_gaussian(centre, narrow * variance / (narrow + variance), [&](float theta) {
      const float c = std::max(0.0f, std::cos(theta));
      const glm::vec2 norm = shading::lobe_norm(lobes, kHalfPi - std::fabs(theta));
      const float d = theta + theta_o;
      const float m = std::exp(-0.5f * d * d / narrow) / (transmission ? norm.y : norm.x);
      const glm::vec3 f = shading::fresnel(material.c_r, c);
      const glm::vec3 colour = transmission ? (glm::vec3(1) - f) * material.c_tt : f;
      return colour * (gaussian(theta - theta_d, variance) * m * c * c);
    });
  };
  const glm::vec3 sum = lobe(material.beta_r, false) / shading::kTwoPi +
                        lobe(material.beta_tt, true) * transmitted_azimuth(straight);
  return sum * (std::cos(theta_d) / power);
}

// Their sums over all paths with one and with three backward scatterings. As the series holds some
// of the paths of a stack of fibres and none twice, a_b + A_b <= 1 when a_f + a_b <= 1.
glm::vec3 DualFibre::backward_attenuation(const Averages& averages) {
  glm::vec3 result(0);
  for (int c = 0; c < 3; ++c) {
    const float f2 = averages.forward[c] * averages.forward[c];
    const float b = averages.backward[c];
    const float open = std::max(1 - f2, 1e-6f);
    result[c] = b * f2 / open + b * b * b * f2 / (open * open * open);
  }
  return result;
}

glm::vec3 DualFibre::returned(float theta_d, float theta_o, float straight, float variance) const {
  const float off = std::fabs(straight);
  const float backward = variance > 0 ? off / kPi : (off > kHalfPi ? 1.0f : 0.0f);
  if (!(backward > 0)) {
    return glm::vec3(0);
  }
  const Averages at = averages(0.5f * (theta_o - theta_d));
  const float f = mean(at.forward);
  const float b = mean(at.backward);
  const float b3 = b * b * b;
  const float vf = at.forward_variance;
  const float vb = at.backward_variance;
  // Eq. 17: the average deviation of what comes back.
  const float sigma_b = (1 + f * f) *
                        (b * std::sqrt(2 * vf + vb) + b3 * std::sqrt(2 * vf + 3 * vb)) /
                        std::max(b + b3 * (2 * std::sqrt(vf) + 3 * std::sqrt(vb)), 1e-12f);
  const float spread = sigma_b * sigma_b + variance;
  const float lobe = gaussian(theta_o + theta_d, spread) / power_of_gaussian(theta_d, spread);
  return backward_attenuation(at) * (backward / kPi * lobe * std::cos(theta_d));
}

}  // namespace weft::render
