#pragma once

#include <limits>

#include <glm/vec3.hpp>

namespace weft::render {

// A half line in the world; positions in millimetres.
struct Ray {
  glm::dvec3 origin_mm{0, 0, 0};
  glm::dvec3 direction{0, 0, 1};  // unit

  [[nodiscard]] glm::dvec3 at(double t_mm) const { return origin_mm + t_mm * direction; }
};

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace weft::render
