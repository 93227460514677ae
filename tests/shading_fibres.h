#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <glm/vec3.hpp>

#include "shading/fibre_bcsdf.h"
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

// The four grey materials with their tables; making these takes longer than a test of them.
inline const FibreBcsdf& published(std::size_t index) {
  static const std::array<FibreBcsdf, 4> all{FibreBcsdf(grey_material(vectors::kFibres[0])),
                                             FibreBcsdf(grey_material(vectors::kFibres[1])),
                                             FibreBcsdf(grey_material(vectors::kFibres[2])),
                                             FibreBcsdf(grey_material(vectors::kFibres[3]))};
  return all[index];
}

// The direction at longitude theta and azimuth phi about a fibre along x.
inline glm::vec3 fibre_direction(double theta, double phi) {
  return {static_cast<float>(std::sin(theta)), static_cast<float>(std::cos(theta) * std::cos(phi)),
          static_cast<float>(std::cos(theta) * std::sin(phi))};
}

}  // namespace weft::shading
