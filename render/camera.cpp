#include "render/camera.h"

#include <glm/geometric.hpp>

#include "core/check.h"

namespace weft::render {

Camera::Camera(const View& view, double aspect) {
  frame_.position_mm = view.position_mm;
  frame_.perspective = view.perspective;
  frame_.forward = glm::normalize(view.look_at_mm - view.position_mm);
  const glm::dvec3 right = glm::cross(frame_.forward, view.up);
  CHECK_GT(glm::length(right), 0.0);
  frame_.across = glm::normalize(right) * view.height * aspect;
  frame_.down = glm::cross(frame_.forward, glm::normalize(right)) * view.height;
}

Ray Camera::ray(const glm::dvec2& picture) const {
  const glm::dvec3 offset = (picture.x - 0.5) * frame_.across + (picture.y - 0.5) * frame_.down;
  if (frame_.perspective) {
    return {frame_.position_mm, glm::normalize(frame_.forward + offset)};
  }
  return {frame_.position_mm + offset, frame_.forward};
}

}  // namespace weft::render
