#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <glm/vec3.hpp>

namespace weft::transport {

// A direction uniform over the sphere from two uniform numbers in [0, 1).
[[nodiscard]] inline glm::vec3 uniform_direction(float u_z, float u_phi) {
  const float z = 1 - 2 * u_z;
  const float phi = 2 * std::numbers::pi_v<float> * u_phi;
  const float r = std::sqrt(std::fmax(0.0f, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

// The square image of the sphere that visibility lives in: row r has polar angle
// theta = (r + 1/2) pi / resolution from +z, column c has phi = (c + 1/2) 2 pi / resolution from +x
// towards +y. Pixel (r, c) has number r * resolution + c.
[[nodiscard]] inline double row_theta(std::uint32_t row, std::uint32_t resolution) {
  return (row + 0.5) * std::numbers::pi / resolution;
}
[[nodiscard]] inline double column_phi(std::uint32_t column, std::uint32_t resolution) {
  return (column + 0.5) * 2 * std::numbers::pi / resolution;
}

// Solid angle of one pixel of a row; all pixels sum to 4 pi.
[[nodiscard]] inline double pixel_solid_angle(std::uint32_t row, std::uint32_t resolution) {
  const double step = std::numbers::pi / resolution;
  return 2 * std::numbers::pi / resolution * (std::cos(row * step) - std::cos((row + 1) * step));
}

}  // namespace weft::transport
