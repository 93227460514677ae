#include <algorithm>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "core/half.h"
#include "render/precomputed_fabric.h"
#include "shading/visibility.h"

// The formulas of local shading; precomputed_fabric.cpp prepares and looks up.

namespace weft::render {
namespace {

using shading::ShVector;
using shading::SphericalGaussian;

// Terms of the sum of Gaussians below this share of the largest possible one are left out.
constexpr float kNegligibleLogScale = -20.0f;

glm::vec3 gamma_at(const ShadingPoint& at, const SphericalGaussian& flat, int method) {
  const SphericalGaussian local{at.to_fibre * flat.axis, flat.sharpness};
  return shading::gamma_integral(at.bcsdf->lobes(), local, at.omega_o, method);
}

}  // namespace

glm::vec3 PrecomputedFabric::unoccluded_directional(const ShadingPoint& at, glm::vec3 omega_d) {
  return at.bcsdf->evaluate_cos(at.to_fibre * omega_d, at.omega_o);
}

glm::vec3 PrecomputedFabric::unoccluded_sg(const ShadingPoint& at,
                                           const SphericalGaussian& light) const {
  return gamma_at(at, light, settings_.gamma_method) / shading::sg_mass(light.sharpness);
}

glm::vec3 PrecomputedFabric::single_directional(const ShadingPoint& at, glm::vec3 omega_d) const {
  return sees(at.segment, omega_d) ? unoccluded_directional(at, omega_d) : glm::vec3(0);
}

// L = 1 / M(lambda) sum_q w_q / M(lambda_v) e^-x_q Gamma(s_q / |s_q|, |s_q|, omega_o), where q's
// Gaussian times the light is e^-x_q times the Gaussian of s_q (section 5.2.2, with the light's
// 1 / M(lambda), which is missing in print).
glm::vec3 PrecomputedFabric::single_by_gaussians(const ShadingPoint& at,
                                                 const SphericalGaussian& light) const {
  const std::uint16_t* weights = db_.ssg.data() + std::size_t{at.segment} * db_.sg_count;
  const float turn = static_cast<float>(db_.ssg_rotation[at.segment]) * (shading::kTwoPi / 65536);
  const float c = std::cos(turn);
  const float s = std::sin(turn);
  glm::vec3 sum(0);
  for (std::size_t q = 0; q < sg_axes_.size(); ++q) {
    const float weight = core::float_from_half(weights[q]);
    if (!(weight > 0)) {
      continue;
    }
    const glm::vec3& axis = sg_axes_[q];
    const SphericalGaussian open{{c * axis.x - s * axis.y, s * axis.x + c * axis.y, axis.z},
                                 db_.sg_sharpness};
    const shading::SgProduct product = shading::sg_product(open, light);
    if (product.log_scale < kNegligibleLogScale) {
      continue;
    }
    sum +=
        gamma_at(at, product.sg, settings_.gamma_method) * (weight * std::exp(product.log_scale));
  }
  return sum / (shading::sg_mass(db_.sg_sharpness) * shading::sg_mass(light.sharpness));
}

glm::vec3 PrecomputedFabric::single_sg(const ShadingPoint& at,
                                       const SphericalGaussian& light) const {
  if (db_.open_share[at.segment] == 0) {
    return glm::vec3(0);
  }
  const float share =
      shading::ssdf_share(light.sharpness, settings_.blend_low, settings_.blend_high);
  glm::vec3 radiance(0);
  if (share < 1) {
    radiance += single_by_gaussians(at, light) * (1 - share);
  }
  if (share > 0) {
    const float visible =
        shading::ssdf_visibility(signed_distance(at.segment, light.axis), light.sharpness);
    if (visible > 0) {
      radiance += unoccluded_sg(at, light) * (visible * share);
    }
  }
  return radiance;
}

ShVector PrecomputedFabric::transferred(std::size_t cell, std::size_t channel,
                                        const ShVector& c_light) const {
  const std::size_t n = (std::size_t{db_.sh_order} + 1) * (std::size_t{db_.sh_order} + 1);
  const float* row = db_.transfer.data() + (cell * 3 + channel) * n * n;
  ShVector c_t = shading::sh_zero();
  for (std::size_t j1 = 0; j1 < n; ++j1, row += n) {
    float sum = 0;
    for (std::size_t j0 = 0; j0 < n; ++j0) {
      sum += row[j0] * c_light.c[j0];
    }
    c_t.c[j1] = sum;
  }
  return c_t;
}

CellRadiance PrecomputedFabric::light_cells(const ShVector& c_light) const {
  CellRadiance light;
  light.c_t.reserve(db_.cell_paths.size() * 3);
  for (std::size_t cell = 0; cell < db_.cell_paths.size(); ++cell) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      light.c_t.push_back(transferred(cell, channel, c_light));
    }
  }
  return light;
}

glm::vec3 PrecomputedFabric::multiple(const ShadingPoint& at, const CellRadiance& light) const {
  const ShVector* c_t = light.c_t.data() + std::size_t{db_.cell_of_segment[at.segment]} * 3;
  return {shading::sh_dot(at.c_s[0], c_t[0]), shading::sh_dot(at.c_s[1], c_t[1]),
          shading::sh_dot(at.c_s[2], c_t[2])};
}

glm::vec3 PrecomputedFabric::multiple(const ShadingPoint& at, const ShVector& c_light) const {
  const std::size_t cell = db_.cell_of_segment[at.segment];
  glm::vec3 radiance(0);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    radiance[static_cast<glm::length_t>(channel)] =
        shading::sh_dot(at.c_s[channel], transferred(cell, channel, c_light));
  }
  return radiance;
}

ShVector harmonics_of_directional(glm::vec3 omega_d) {
  return omega_d.z > 0 ? shading::sh_evaluate(omega_d) : shading::sh_zero();
}

ShVector harmonics_of_sg(const SphericalGaussian& light) {
  return shading::sh_zonal_about(shading::sg_zonal(light.sharpness), light.axis);
}

}  // namespace weft::render
