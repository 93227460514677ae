#pragma once

#include <map>
#include <memory>

#include "render/baselines/segment_transfer.h"
#include "render/integrator.h"
#include "render/scene.h"

namespace weft::render {

// Shades every fibre that an eye ray meets by standard PRT: C_S . (D(R) A c_light) with a matrix A
// of the fibre's own segment that holds direct light too (SegmentTransfer). What the paper's
// figures 11 and 12 compare with; slow, for every segment in the picture is precomputed on the way.
// Distant occlusion is a shadow of the shell, as in PrecomputedIntegrator. Spherical Gaussian
// lights keep their harmonics, other lights are drawn. What it sees is not told apart by
// scatterings. Keeps a reference to `scene`, which must outlive it.
class PrtIntegrator : public Integrator {
 public:
  // REQUIRES: every piece of cloth has a fabric with something precomputed (C_S is read from it).
  PrtIntegrator(const Scene& scene, const PrtSettings& settings);
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override;

 private:
  const Scene& scene_;
  std::map<const Fabric*, std::unique_ptr<SegmentTransfer>> transfer_;  // caches: they fill
};

// C_S . c_T of a shading point, per channel.
[[nodiscard]] glm::vec3 radiance_of(const ShadingPoint& at,
                                    const std::array<shading::ShVector, 3>& c_t);

}  // namespace weft::render
