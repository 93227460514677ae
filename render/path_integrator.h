#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "render/integrator.h"
#include "render/scene.h"
#include "shading/fibre_bcsdf.h"

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
// surface cosine), after which that fibre is ignored until the next one. Paths go on by one lobe
// or by several, as their throughput says (FibreBcsdf::scatter); multiple importance sampling
// weighs each lobe by itself, its density being that of the paths that go on by it. Keeps a
// reference to `scene`, which must outlive it and keep its lights.
class PathIntegrator : public Integrator {
 public:
  PathIntegrator(const Scene& scene, const PathSettings& settings);
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override;

 private:
  struct Arrival;
  struct Vertex;
  struct Followed;
  struct Next;
  // Whether light that met so many fibres counts.
  [[nodiscard]] bool is_wanted(std::uint32_t scatterings) const;
  // How much more light comes from above the flat fabric than from below, from -1 to 1.
  [[nodiscard]] float lit_from(const SceneHit& hit) const;
  // Of a path there, in cloth lit like this.
  [[nodiscard]] float worth(const SceneHit& hit, float lit) const;
  [[nodiscard]] Vertex vertex_at(const Arrival& arrival) const;
  // How many paths go on, 1 + room at most.
  [[nodiscard]] shading::LobeOdds odds_at(const Vertex& vertex, float worth,
                                          std::size_t room) const;
  [[nodiscard]] glm::vec3 from_lights(const Vertex& vertex, core::Random& random) const;
  [[nodiscard]] glm::vec3 from_direction(const Vertex& vertex, const Followed& followed,
                                         const Next& next) const;
  // One path that goes on, to the next fibre; adds the light that it meets.
  [[nodiscard]] std::optional<Arrival> go_on(const Vertex& vertex, float u_lobe,
                                             core::Random& random, EyeSample& seen) const;
  // All that go on: the first of them; those besides are appended to `pending`.
  [[nodiscard]] std::optional<Arrival> scatter(const Vertex& vertex, core::Random& random,
                                               EyeSample& seen,
                                               std::vector<Arrival>& pending) const;
  [[nodiscard]] Next follow(const Vertex& vertex, const Ray& ray) const;
  [[nodiscard]] bool reaches_light(const Vertex& vertex, const Ray& ray, double distance_mm) const;

  const Scene& scene_;
  PathSettings settings_;
  std::uint32_t limit_;     // of scatterings; 0: none
  bool lights_can_be_met_;  // by a ray: some light is not of one direction
  glm::vec3 towards_lights_;
};

}  // namespace weft::render
