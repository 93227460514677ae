#pragma once

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

// Directions drawn from simple densities; each sample_x has its pdf_x, per steradian.

namespace weft::render {

inline constexpr double kPi = 3.14159265358979323846;

// A right-handed frame whose z axis is `normal` (Duff et al. 2017, "Building an Orthonormal Basis,
// Revisited"); local coordinates to the frame of `normal`.
[[nodiscard]] inline glm::dvec3 from_local(const glm::dvec3& local, const glm::dvec3& normal) {
  const double sign = std::copysign(1.0, normal.z);
  const double a = -1.0 / (sign + normal.z);
  const double b = normal.x * normal.y * a;
  const glm::dvec3 x(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
  const glm::dvec3 y(b, sign + normal.y * normal.y * a, -normal.y);
  return local.x * x + local.y * y + local.z * normal;
}

[[nodiscard]] inline glm::dvec3 direction_of(double cos_theta, double phi) {
  const double sin_theta = std::sqrt(std::fmax(0.0, 1.0 - cos_theta * cos_theta));
  return {sin_theta * std::cos(phi), sin_theta * std::sin(phi), cos_theta};
}

[[nodiscard]] inline glm::dvec3 sample_sphere(double u1, double u2) {
  return direction_of(1.0 - 2.0 * u1, 2.0 * kPi * u2);
}
[[nodiscard]] inline double pdf_sphere() { return 1.0 / (4.0 * kPi); }

// Mass of a spherical Gaussian, M(lambda) = 2 pi (1 - exp(-2 lambda)) / lambda.
[[nodiscard]] inline double sg_mass(double lambda) {
  return lambda < 1e-8 ? 4.0 * kPi * (1.0 - lambda)
                       : -2.0 * kPi * std::expm1(-2.0 * lambda) / lambda;
}

// Density G / M about the unit `axis`: the cosine has the distribution function
// (exp(lambda (c - 1)) - exp(-2 lambda)) / (1 - exp(-2 lambda)), inverted.
[[nodiscard]] inline glm::dvec3 sample_sg(const glm::dvec3& axis, double lambda, double u1,
                                          double u2) {
  const double cos_theta =
      lambda < 1e-8 ? 1.0 - 2.0 * u1 : 1.0 + std::log1p(u1 * std::expm1(-2.0 * lambda)) / lambda;
  return glm::normalize(from_local(direction_of(std::fmax(-1.0, cos_theta), 2.0 * kPi * u2), axis));
}
[[nodiscard]] inline double pdf_sg(const glm::dvec3& axis, double lambda,
                                   const glm::dvec3& direction) {
  return std::exp(lambda * (glm::dot(axis, direction) - 1.0)) / sg_mass(lambda);
}

}  // namespace weft::render
