#pragma once

#include <memory>
#include <optional>
#include <variant>

#include <glm/vec3.hpp>

#include "render/environment.h"
#include "render/ray.h"

namespace weft::render {

// Parallel light: a plane that faces it receives `irradiance`.
struct DirectionalLight {
  glm::dvec3 towards;  // unit, to the light
  glm::vec3 irradiance;
};

// Radiance irradiance G(omega; towards, sharpness) / M(sharpness) from infinity, zero below the
// horizon when cut.
struct SgLight {
  glm::dvec3 towards;  // unit
  double sharpness;
  glm::vec3 irradiance;
  bool cut_at_horizon = false;
};

struct PointLight {
  glm::dvec3 position_mm;
  glm::vec3 intensity;  // per steradian; over mm^2
};

// Shines to the side of edge_a x edge_b. It hides nothing.
struct RectangleLight {
  glm::dvec3 corner_mm;
  glm::dvec3 edge_a_mm;
  glm::dvec3 edge_b_mm;
  glm::vec3 radiance;
};

struct DiscLight {
  glm::dvec3 centre_mm;
  glm::dvec3 normal;  // unit; the side that shines
  double radius_mm;
  glm::vec3 radiance;
};

// The same radiance from everywhere.
struct UniformLight {
  glm::vec3 radiance;
  bool cut_at_horizon = false;
};

struct EnvironmentLight {
  std::shared_ptr<const Environment> environment;  // shared: immutable and large, lights are copied
  bool cut_at_horizon = false;
};

using Light = std::variant<DirectionalLight, SgLight, PointLight, RectangleLight, DiscLight,
                           UniformLight, EnvironmentLight>;

// Light that arrives at a point from a drawn direction.
struct LightSample {
  glm::dvec3 direction{0, 0, 1};  // unit, to the light
  double distance_mm = kInfinity;
  glm::vec3 radiance{0, 0, 0};  // irradiance for a light of one direction
  double pdf = 1;               // per steradian; 1 for a light of one direction
  bool one_direction = false;   // directional and point lights: no ray can meet them by chance
};

// Draws a direction towards `light` from a point. radiance / pdf is an unbiased estimate of what
// arrives when nothing is in the way; radiance is zero for a useless sample.
[[nodiscard]] LightSample sample_light(const Light& light, const glm::dvec3& point_mm, double u1,
                                       double u2);

// What a ray that meets nothing else receives from `light`, and the density with which
// sample_light would have drawn its direction; nothing where the light does not shine along it.
struct Emission {
  double distance_mm = kInfinity;
  glm::vec3 radiance{0, 0, 0};
  double pdf = 0;
};
[[nodiscard]] std::optional<Emission> emission(const Light& light, const Ray& ray);

}  // namespace weft::render
