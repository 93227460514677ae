#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "render/ray.h"

namespace weft::render {

// Triangles for rays to meet: the outside of a shell. Besides transport/scene, which has the
// fibres, the one place that knows Embree. Immutable: any thread may call.
class TriangleScene {
 public:
  // Three corners for each triangle. Throws core::Error(kResourceExhausted) when Embree cannot
  // build it.
  explicit TriangleScene(const std::vector<glm::vec3>& corners_mm);
  ~TriangleScene();
  TriangleScene(const TriangleScene&) = delete;
  TriangleScene& operator=(const TriangleScene&) = delete;
  TriangleScene(TriangleScene&&) = delete;
  TriangleScene& operator=(TriangleScene&&) = delete;

  struct Hit {
    double t_mm;
    std::uint32_t triangle;
  };
  // The first triangle, from either side, between two distances along the ray.
  [[nodiscard]] std::optional<Hit> closest(const Ray& ray, double t_min_mm, double t_max_mm) const;
  [[nodiscard]] bool occluded(const Ray& ray, double t_min_mm, double t_max_mm) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace weft::render
