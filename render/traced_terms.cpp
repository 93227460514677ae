#include "render/traced_terms.h"

#include <limits>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"
#include "transport/bake_point.h"
#include "transport/path.h"

namespace weft::render {
namespace {

constexpr std::uint32_t kSeenRaysPerSegment = 16;  // as the planner has it
constexpr std::uint64_t kSeed = 1;
constexpr std::uint32_t kLongestPath = 10000;  // scatterings, as the bakers have it

}  // namespace

TracedTerms::TracedTerms(const Fabric& fabric) : fabric_(fabric) {
  CHECK(fabric.precomputed() != nullptr);
  const storage::FabricDatabase& database = fabric.precomputed()->database();
  cells_ = transport::segments_by_cell(
      database.cell_of_segment, database.cell_paths.size(),
      transport::seen_segments(fabric.scene(), kSeenRaysPerSegment, kSeed));
}

glm::vec3 TracedTerms::single(const ShadingPoint& at, glm::vec3 omega_d) const {
  const glm::vec3 open = PrecomputedFabric::unoccluded_directional(at, omega_d);
  if (open == glm::vec3(0)) {
    return open;
  }
  const transport::Scene& scene = fabric_.scene();
  const transport::BakePoint from = transport::bake_point(scene, at.segment);
  const auto hit =
      scene.closest(from.position_mm, omega_d, std::numeric_limits<float>::infinity(), from.own);
  return hit ? glm::vec3(0) : open;
}

glm::vec3 TracedTerms::multiple(const ShadingPoint& at, glm::vec3 omega_d, TermSource source,
                                core::Random& random) const {
  std::uint32_t segment = at.segment;
  if (source == TermSource::kCell) {
    segment = cells_[fabric_.precomputed()->database().cell_of_segment[segment]].draw(random);
  }
  const float u_lobe = random.uniform();
  const float u_theta = random.uniform();
  const shading::BcsdfSample sample =
      at.bcsdf->sample(at.omega_o, u_lobe, u_theta, random.uniform());
  if (!(sample.pdf > 0)) {
    return glm::vec3(0);
  }
  transport::Path path(fabric_.scene(), fabric_.bcsdfs(), segment,
                       glm::normalize(glm::transpose(at.to_fibre) * sample.omega_i));
  glm::vec3 radiance(0);
  while (path.advance() && path.vertices() <= kLongestPath) {
    radiance += path.throughput() * path.reflected(omega_d);
    if (!path.scatter(random)) {
      break;
    }
  }
  return sample.weight * radiance;
}

}  // namespace weft::render
