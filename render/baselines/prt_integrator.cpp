#include "render/baselines/prt_integrator.h"

#include <variant>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "render/eye_surface.h"

namespace weft::render {

PrtIntegrator::PrtIntegrator(const Scene& scene, const PrtSettings& settings) : scene_(scene) {
  for (const auto& cloth : scene.cloths) {
    for (const auto& fabric : cloth->fabrics().fabrics()) {
      CHECK(fabric->precomputed() != nullptr);
      std::unique_ptr<SegmentTransfer>& transfer = transfer_[fabric.get()];
      if (!transfer) {
        transfer = std::make_unique<SegmentTransfer>(*fabric, settings);
      }
    }
  }
}

glm::vec3 radiance_of(const ShadingPoint& at, const std::array<shading::ShVector, 3>& c_t) {
  return {shading::sh_dot(at.c_s[0], c_t[0]), shading::sh_dot(at.c_s[1], c_t[1]),
          shading::sh_dot(at.c_s[2], c_t[2])};
}

EyeSample PrtIntegrator::trace(const Ray& ray, core::Random& random) const {
  const SceneMeeting first = closest(scene_, ray, kInfinity, nullptr);
  if (first.fate != Fate::kFibre) {
    return {first.fate == Fate::kNothing ? scene_.background : glm::vec3(0), false};
  }
  const FibreHit& hit = first.hit.fibre;
  const Cloth& cloth = *scene_.cloths[first.hit.cloth];
  const Fabric& fabric = cloth.fabric(hit);
  const ShadingPoint point = fabric.precomputed()->point(
      hit.segment, hit.tangent, glm::normalize(hit.to_flat * glm::vec3(-ray.direction)));
  const glm::dvec3 top_mm = cloth.top_point(hit, glm::dvec2(0)).value_or(hit.world_mm);
  EyeSample seen;
  describe_surface(first.hit, seen);
  for (const Light& light : scene_.lights) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const LightSample sample = sample_light(light, hit.world_mm, u1, u2);
    if (sample.radiance == glm::vec3(0) ||
        blocked_by_cloth(scene_, {top_mm, sample.direction}, sample.distance_mm)) {
      continue;
    }
    shading::ShVector c_light =
        harmonics_of_directional(glm::normalize(hit.to_flat * glm::vec3(sample.direction)));
    if (const auto* sg = std::get_if<SgLight>(&light)) {
      c_light = harmonics_of_sg({glm::normalize(hit.to_flat * glm::vec3(sg->towards)),
                                 static_cast<float>(sg->sharpness)});
    }
    seen.radiance += radiance_of(point, transfer_.at(&fabric)->transferred(hit.segment, c_light)) *
                     sample.radiance / static_cast<float>(sample.pdf);
  }
  return seen;
}

}  // namespace weft::render
