#pragma once

#include <map>

#include "render/baselines/dual_fibre.h"
#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

// Dual scattering (Zinke et al. 2008) in cloth, as a baseline (Khungurn et al. 2017, section 6.3,
// footnote 1: all density factors 1). A direction is drawn towards every light and followed
// straight through the fibres in its way, each of which attenuates and spreads the light by its
// averages (DualFibre); where there is none, light scatters directly. Single scattering is the
// latter; multiple scattering is what came through fibres, and what comes back from the fibres
// behind. `local`: as PathSettings::local.
//
// What the method assumes and cloth breaks: that fibres near by are parallel and of one material.
// Each fibre that is crossed counts with its own angle and material here, but all spread is taken
// about the axis of the fibre that is shaded, and what comes back comes from its own like.
// Keeps a reference to `scene`, which must outlive it.
class DualIntegrator : public Integrator {
 public:
  DualIntegrator(const Scene& scene, bool local, Scattering scattering);
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override;

 private:
  // What is left of the light that comes straight along a ray.
  struct Arrival {
    glm::vec3 share{0, 0, 0};  // T_f; zero where something opaque is in the way
    float variance = 0;        // sigma_f^2
    bool direct = true;        // no fibre is in the way
  };
  [[nodiscard]] Arrival arrival(const SceneHit& hit, const glm::dvec3& direction,
                                double distance_mm) const;
  [[nodiscard]] bool cross(const FibreHit& fibre, const Fabric& fabric, const glm::dvec3& direction,
                           Arrival& so_far) const;
  [[nodiscard]] const DualFibre& fibre_of(const Fabric& fabric, std::uint32_t strand) const;

  const Scene& scene_;
  bool local_;
  Scattering scattering_;
  std::map<const Fabric*, std::vector<DualFibre>> fibres_;  // by material
};

}  // namespace weft::render
