#pragma once

#include <optional>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/random.h"
#include "render/fabric.h"

namespace weft::render {

// What one eye ray onto flat cloth sees.
struct MapSample {
  float z_mm = 0;
  glm::vec3 normal{0, 0, 1};   // of the fibre's surface, unit
  glm::vec3 tangent{1, 0, 0};  // of the fibre, unit
  const shading::FibreBcsdf* bcsdf = nullptr;
  // Radiance towards the eye under a white sky: of the first reflection (R), and all else.
  glm::vec3 reflected{0, 0, 0};
  glm::vec3 albedo{0, 0, 0};
};

// Eye rays onto endless flat cloth under a white sky: radiance 1 from above, nothing from below.
// Immutable: any thread may call.
class MapEye {
 public:
  // REQUIRES: a fabric with what was precomputed, which outlives this.
  explicit MapEye(const Fabric& fabric);

  // What is seen from direction `towards_eye` (unit, upwards) at a point of the plane z = z_max;
  // nothing when the ray meets no fibre.
  [[nodiscard]] std::optional<MapSample> look(glm::vec2 at_mm, glm::vec3 towards_eye) const;

  // One path's estimate of what a sky of radiance 1 below the cloth, and none above, sends to an
  // eye straight above through the fibres.
  [[nodiscard]] glm::vec3 from_below(glm::vec2 at_mm, core::Random& random) const;

 private:
  struct Meeting {
    std::uint32_t segment;
    glm::vec3 position_mm;
  };
  [[nodiscard]] std::optional<Meeting> meet(glm::vec2 at_mm, glm::vec3 towards_eye) const;
  void light(const ShadingPoint& at, MapSample& sample) const;

  const Fabric& fabric_;
  CellRadiance sky_;  // after the transfer of every cell
};

}  // namespace weft::render
