#pragma once

#include <cmath>

#include <glm/vec3.hpp>

#include "shading/fibre_material.h"
#include "tests/shading_vectors.h"

namespace weft::shading {

// A grey material of one published channel.
inline FibreMaterial grey_material(const vectors::Fibre& f) {
  FibreMaterial m;
  m.c_r = glm::vec3(static_cast<float>(f.c_r));
  m.c_tt = glm::vec3(static_cast<float>(f.c_tt));
  m.beta_r = static_cast<float>(f.beta_r);
  m.beta_tt = static_cast<float>(f.beta_tt);
  m.gamma_tt = static_cast<float>(f.gamma_tt);
  return m;
}

// The direction at longitude theta and azimuth phi about a fibre along x.
inline glm::vec3 fibre_direction(double theta, double phi) {
  return {static_cast<float>(std::sin(theta)), static_cast<float>(std::cos(theta) * std::cos(phi)),
          static_cast<float>(std::cos(theta) * std::sin(phi))};
}

}  // namespace weft::shading
