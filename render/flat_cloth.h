#pragma once

#include <memory>

#include "render/cloth.h"

namespace weft::render {

struct FlatPlacement {
  glm::dvec2 size_mm{0, 0};  // both positive
  bool endless = false;      // no border; size_mm then only serves framing
  double turn = 0;           // radians, about z, counterclockwise
  glm::dvec3 centre_mm{0, 0, 0};
  bool black_underlay = false;
};

// A flat rectangle of cloth, level, its upper side up. The origin of the flat fabric is at its
// centre; in patterned cloth at its corner of least x and y, so that a rectangle of whole patterns
// shows them whole.
[[nodiscard]] std::unique_ptr<Cloth> make_flat_cloth(ClothFabric fabrics,
                                                     const FlatPlacement& placement);

// The same of one fabric, which is shared by the pieces of one scene.
[[nodiscard]] std::unique_ptr<Cloth> make_flat_cloth(std::shared_ptr<const Fabric> fabric,
                                                     const FlatPlacement& placement);

}  // namespace weft::render
