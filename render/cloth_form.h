#pragma once

#include <variant>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "render/shell_geometry.h"

namespace weft::render {

// A flat piece: flat = to_flat (world - centre_mm), and the cloth is the box between two corners in
// the flat fabric. An endless piece has infinite ones.
struct FlatForm {
  glm::dmat3 to_flat{1};  // a turn about z
  glm::dvec3 centre_mm{0, 0, 0};
  glm::dvec3 low_mm{0, 0, 0};
  glm::dvec3 high_mm{0, 0, 0};
};

// A shell, which belongs to the piece of cloth.
struct ShellForm {
  const ShellGeometry* geometry = nullptr;
  double contact_mm = 0;  // meetings nearer than this with its own outside are rounding
};

struct ClothForm {
  bool black_underlay = false;
  std::variant<FlatForm, ShellForm> shape;
};

}  // namespace weft::render
