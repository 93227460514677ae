#pragma once

#include <cstdint>

#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

struct PathSettings {
  // Paths end where they leave the cloth: through its upper surface they see the lights past the
  // solid pieces of cloth, elsewhere nothing, as the precomputation has it.
  bool local = false;
  std::uint32_t max_scatterings = 0;  // 0: no limit but roulette
  Scattering scattering = Scattering::kAll;
  // How light is found: by drawing points on lights, by following drawn directions, or both by
  // multiple importance sampling (Veach and Guibas 1995, balance heuristic). The three have the
  // same mean; lights of one direction are always drawn.
  enum class Finding { kBoth, kLights, kDirections };
  Finding finding = Finding::kBoth;
  bool wants_shadow = false;  // EyeSample::shadow; the radiance does not depend on it
};

// Follows paths from the eye through every fibre they meet, with all bounces: the reference for
// everything else. Every fibre met is one scattering (maths of Khungurn et al. 2017, section 3: no
// surface cosine), after which that fibre is ignored until the next one. Keeps a reference to
// `scene`, which must outlive it.
class PathIntegrator : public Integrator {
 public:
  PathIntegrator(const Scene& scene, const PathSettings& settings);
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override;

 private:
  struct Vertex;
  struct Next;
  [[nodiscard]] Vertex vertex_at(const SceneHit& hit, const glm::dvec3& towards_eye) const;
  [[nodiscard]] glm::vec3 from_lights(const Vertex& vertex, core::Random& random) const;
  [[nodiscard]] glm::vec3 from_direction(const Next& next, const Ray& ray, double pdf) const;
  [[nodiscard]] Next follow(const Vertex& vertex, const Ray& ray) const;
  [[nodiscard]] bool reaches_light(const Vertex& vertex, const Ray& ray, double distance_mm) const;

  const Scene& scene_;
  PathSettings settings_;
};

}  // namespace weft::render
