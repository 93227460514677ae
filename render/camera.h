#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/ray.h"

namespace weft::render {

// Where the picture is seen from. Picture coordinates run from (0, 0) at the upper left corner to
// (1, 1) at the lower right one.
class Camera {
 public:
  // `height` of the picture: for perspective, the tangent of half the vertical angle times two;
  // orthographic, millimetres. `aspect`: width over height. REQUIRES: position and look_at differ,
  // and up is not along the line between them.
  struct View {
    glm::dvec3 position_mm{0, 0, 1};
    glm::dvec3 look_at_mm{0, 0, 0};
    glm::dvec3 up{0, 1, 0};
    bool perspective = true;
    double height = 0.5;
  };
  Camera() : Camera(View{}, 1.0) {}
  Camera(const View& view, double aspect);

  [[nodiscard]] Ray ray(const glm::dvec2& picture) const;

  // What ray() computes from.
  struct Frame {
    glm::dvec3 position_mm{0, 0, 0};
    glm::dvec3 forward{0, 0, 1};
    glm::dvec3 across{1, 0, 0};  // of the whole picture, to the right
    glm::dvec3 down{0, 1, 0};    // of the whole picture
    bool perspective = true;
  };
  [[nodiscard]] const Frame& frame() const { return frame_; }

 private:
  Frame frame_;
};

}  // namespace weft::render
