#include "render/eye_surface.h"

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace weft::render {

void describe_surface(const SceneHit& hit, EyeSample& seen) {
  const glm::mat3 to_world = glm::transpose(hit.fibre.to_flat);
  seen.on_cloth = true;
  seen.cloth = static_cast<std::uint32_t>(hit.cloth);
  seen.segment = hit.fibre.segment;
  seen.tangent = glm::normalize(to_world * hit.fibre.tangent);
  seen.normal = glm::normalize(to_world * glm::vec3(0, 0, 1));
}

float share_let_through(const Scene& scene, const SceneHit& hit, core::Random& random) {
  const FibreHit& fibre = hit.fibre;
  const glm::dvec3 top_mm =
      scene.cloths[hit.cloth]->top_point(fibre, glm::dvec2(0)).value_or(fibre.world_mm);
  double arriving = 0;
  double through = 0;
  for (const Light& light : scene.lights) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const LightSample sample = sample_light(light, fibre.world_mm, u1, u2);
    const glm::vec3 direction = fibre.to_flat * glm::vec3(sample.direction);
    const auto radiance =
        static_cast<double>(sample.radiance.x + sample.radiance.y + sample.radiance.z);
    if (!(direction.z > 0) || !(radiance > 0)) {
      continue;
    }
    const double weight = radiance / sample.pdf;
    arriving += weight;
    Ray ray{top_mm, sample.direction};
    double distance_mm = kInfinity;
    if (sample.distance_mm < kInfinity) {
      const glm::dvec3 way = fibre.world_mm + sample.distance_mm * sample.direction - top_mm;
      distance_mm = glm::length(way);
      if (!(distance_mm > 0)) {
        continue;
      }
      ray.direction = way / distance_mm;
    }
    if (!blocked_by_cloth(scene, ray, distance_mm)) {
      through += weight;
    }
  }
  return arriving > 0 ? static_cast<float>(through / arriving) : 0.0f;
}

}  // namespace weft::render
