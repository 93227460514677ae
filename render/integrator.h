#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "core/random.h"
#include "render/layers.h"
#include "render/ray.h"

namespace weft::render {

// Which light is wanted, by how often it met a fibre.
enum class Scattering { kAll, kSingleOnly, kMultipleOnly };

// What one eye ray saw.
struct EyeSample {
  glm::vec3 radiance{0, 0, 0};
  bool on_cloth = false;  // it met a fibre
  // Of what met a fibre (the background is neither):
  glm::vec3 single{0, 0, 0};         // the part of radiance that met one fibre,
  glm::vec3 multiple{0, 0, 0};       // and that met more
  float shadow = 0;                  // share_let_through; 0 when it was not wanted
  std::uint32_t cloth = kNoSegment;  // index of the piece of cloth
  std::uint32_t segment = kNoSegment;
  glm::vec3 tangent{0, 0, 0};  // of the fibre, unit, in the world
  glm::vec3 normal{0, 0, 0};   // of the cloth, unit, in the world
};

// Estimates the radiance along eye rays, without bias to its own idea of transport. Any thread may
// call; what returns depends on nothing but the ray and the random numbers.
class Integrator {
 public:
  Integrator() = default;
  Integrator(const Integrator&) = delete;
  Integrator& operator=(const Integrator&) = delete;
  Integrator(Integrator&&) = delete;
  Integrator& operator=(Integrator&&) = delete;
  virtual ~Integrator() = default;

  [[nodiscard]] virtual EyeSample trace(const Ray& ray, core::Random& random) const = 0;
};

}  // namespace weft::render
