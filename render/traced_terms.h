#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "core/random.h"
#include "render/fabric.h"
#include "render/precomputed_fabric.h"
#include "transport/seen_segments.h"

namespace weft::render {

// Where a term of precomputed shading is taken from. Comparing neighbours in this list says which
// step of the precomputation costs what: path tracing from the hit itself (PathIntegrator, local)
// -> kSegment (every hit of a segment counts as its bake point) -> kCell (transfer is averaged over
// a cell) -> kDatabase (harmonics of limited order; distances by principal components).
enum class TermSource { kDatabase, kCell, kSegment };
struct TermSources {
  TermSource single = TermSource::kDatabase;  // kCell means kSegment: nothing is averaged
  TermSource multiple = TermSource::kDatabase;
};

// Terms of local shading by tracing rays through the fabric's fibres, without bias: what the
// database would give were its tables exact. Needs a fabric with something precomputed, which must
// outlive it. Immutable: any thread may call.
class TracedTerms {
 public:
  explicit TracedTerms(const Fabric& fabric);

  // Light of unit irradiance from omega_d (flat fabric) that scatters once at the point: the
  // segment's bake point sees it or not.
  [[nodiscard]] glm::vec3 single(const ShadingPoint& at, glm::vec3 omega_d) const;
  // One path's estimate of what scatters more than once, from the segment's bake point (kSegment)
  // or that of a segment drawn from its cell (kCell).
  [[nodiscard]] glm::vec3 multiple(const ShadingPoint& at, glm::vec3 omega_d, TermSource source,
                                   core::Random& random) const;

 private:
  const Fabric& fabric_;
  std::vector<transport::CellSegments> cells_;
};

}  // namespace weft::render
