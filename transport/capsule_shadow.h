#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "transport/cover_mask.h"

namespace weft::transport {

// Sines and cosines of the image's rows and columns.
struct SphereGrid {
  explicit SphereGrid(std::uint32_t resolution);
  std::uint32_t resolution;
  std::vector<float> sin_theta;  // [rows], zeros beyond up to whole words of the mask
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

// Covers the pixels of `region` whose centres the capsule hides. Exact: seen from a point outside,
// a capsule hides the caps of its two balls and the quadrilateral between two tangent planes.
// `wide`: wide_is_available() said yes; the bits are the same.
// REQUIRES: !holds_origin(capsule).
void paint(const SeenCapsule& capsule, const ImageRegion& region, const SphereGrid& grid, bool wide,
           CoverMask& mask);

}  // namespace weft::transport
