#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "render/integrator.h"
#include "render/precomputed_fabric.h"
#include "render/scene.h"
#include "render/traced_terms.h"

namespace weft::render {

// Shades every fibre that an eye ray meets from the fabric's database (Khungurn et al. 2017,
// section 5): visibility and transfer of the cloth around it are looked up, and only occlusion by
// cloth as a whole is traced, from the upper surface above the hit. Directional and spherical
// Gaussian lights are shaded in closed form, point lights as directional ones from the hit, area
// and environment lights by drawn directions (section 5.2.1). Keeps a reference to `scene`, which
// must outlive it.
class PrecomputedIntegrator : public Integrator {
 public:
  // REQUIRES: every piece of cloth has a fabric with something precomputed.
  // With `wants_shadow`, EyeSample::shadow is filled; the radiance does not depend on it.
  // `sources` says where each part of the light is taken from.
  PrecomputedIntegrator(const Scene& scene, Scattering scattering, bool wants_shadow = false,
                        const TermSources& sources = {});
  [[nodiscard]] EyeSample trace(const Ray& ray, core::Random& random) const override;

  // Shades Gaussian lights by these settings in place of the fabrics' own.
  void shade_by(const PrecomputedSettings& settings) { settings_ = settings; }

 private:
  struct Shaded;
  struct Arrival;
  struct Drawn;
  struct Scattered;
  [[nodiscard]] Scattered from_light(const Shaded& at, std::size_t light,
                                     core::Random& random) const;
  [[nodiscard]] Scattered from_database(const Shaded& at, std::size_t light,
                                        core::Random& random) const;
  [[nodiscard]] Scattered from_traced(const Shaded& at, std::size_t light,
                                      core::Random& random) const;
  [[nodiscard]] Scattered from_gaussian(const Shaded& at, std::size_t light,
                                        core::Random& random) const;
  [[nodiscard]] Scattered from_drawn(const Shaded& at, std::size_t light,
                                     core::Random& random) const;
  [[nodiscard]] std::optional<Drawn> draw_direction(const Shaded& at, std::size_t light,
                                                    core::Random& random) const;
  [[nodiscard]] glm::vec3 from_fibre_direction(const Shaded& at, const Light& light,
                                               core::Random& random) const;
  [[nodiscard]] bool reaches(const glm::dvec3& from_mm, const Arrival& arrival) const;
  [[nodiscard]] glm::dvec3 neighbour(const Shaded& at, core::Random& random) const;
  [[nodiscard]] glm::vec3 multiple(const Shaded& at, std::size_t light,
                                   const shading::ShVector& harmonics) const;
  // Among the fabrics of all pieces.
  [[nodiscard]] std::size_t fabric_index(const SceneHit& hit) const {
    return first_fabric_[hit.cloth] + hit.fibre.fabric;
  }
  void add_cells(const Fabric& fabric, const std::optional<glm::mat3>& rotation);
  [[nodiscard]] const CellRadiance* cells(const SceneHit& hit, std::size_t light) const;

  const Scene& scene_;
  Scattering scattering_;
  bool wants_shadow_;
  TermSources sources_;
  std::optional<PrecomputedSettings> settings_;
  std::vector<std::size_t> first_fabric_;  // of each piece of cloth, among those of all pieces
  std::vector<TracedTerms> traced_;        // by fabric; empty when everything is looked up
  // [fabrics of all pieces, lights]: after the transfer, where the light's direction in the flat
  // fabric is the same everywhere.
  std::vector<std::optional<CellRadiance>> cells_;
};

}  // namespace weft::render
