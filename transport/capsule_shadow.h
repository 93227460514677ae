#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "transport/cover_mask.h"

namespace weft::transport {

// Sines and cosines of the image's rows and columns.
struct SphereGrid {
  explicit SphereGrid(std::uint32_t resolution);
  std::uint32_t resolution;
  std::vector<float> sin_theta;  // [rows]
  std::vector<float> cos_theta;
  std::vector<float> sin_phi;  // [columns]
  std::vector<float> cos_phi;
};

// A capsule as seen from the origin: its axis from `start` over `length` along the unit vector
// `axis`.
struct SeenCapsule {
  glm::vec3 start;
  glm::vec3 axis;
  float length;
  float radius;
};

[[nodiscard]] bool holds_origin(const SeenCapsule& capsule);

// Finds a rectangle that holds every pixel whose centre a ball hides from the origin, the whole
// image when the ball holds the origin. False when it has no pixel that `mask` does not cover yet;
// `region`, which the caller keeps for the next ball, is then of no meaning.
[[nodiscard]] bool find_open_region(glm::vec3 centre, float radius, const CoverMask& mask,
                                    ImageRegion& region);

// Covers the pixels of `region` whose centres the capsule hides. Exact: seen from a point outside,
// a capsule hides the caps of its two balls and the quadrilateral between two tangent planes.
// REQUIRES: !holds_origin(capsule).
void paint(const SeenCapsule& capsule, const ImageRegion& region, const SphereGrid& grid,
           CoverMask& mask);

}  // namespace weft::transport
