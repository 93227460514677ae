#pragma once

#include <glm/vec3.hpp>

#include "core/random.h"
#include "render/ray.h"

namespace weft::render {

// Which light is wanted, by how often it met a fibre.
enum class Scattering { kAll, kSingleOnly, kMultipleOnly };

// What one eye ray saw.
struct EyeSample {
  glm::vec3 radiance{0, 0, 0};
  bool on_cloth = false;  // it met a fibre
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
