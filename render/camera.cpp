#include "render/camera.h"

#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::render {

Camera::Camera(const View& view, double aspect)
    : position_mm_(view.position_mm), perspective_(view.perspective) {
  forward_ = glm::normalize(view.look_at_mm - view.position_mm);
  const glm::dvec3 right = glm::cross(forward_, view.up);
  CHECK_GT(glm::length(right), 0.0);
  across_ = glm::normalize(right) * view.height * aspect;
  down_ = glm::cross(forward_, glm::normalize(right)) * view.height;
}

Ray Camera::ray(const glm::dvec2& picture) const {
  const glm::dvec3 offset = (picture.x - 0.5) * across_ + (picture.y - 0.5) * down_;
  if (perspective_) {
    return {position_mm_, glm::normalize(forward_ + offset)};
  }
  return {position_mm_ + offset, forward_};
}

}  // namespace weft::render
