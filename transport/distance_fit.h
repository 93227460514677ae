#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "transport/pca.h"
#include "transport/signed_distance.h"

namespace weft::transport {

// Finds the coefficients that stand best for the visibility of a segment. What counts are signs,
// and distances near the edges; an orthogonal projection spends itself on what lies far from them.
// So the coefficients c minimise, over pixels p with the true distance d_p of size y_p = |d_p|,
//
//   sum of w_p (m_p - sign(d_p) f_p(c))^2,   f(c) = mean + sum of c_i component_i,
//   m_p = min(y_p, kDistanceClamp),   w_p = 1 / (1 + (y_p / kEdgeWidth)^2),
//
// where what is beyond the clamp on the right side costs nothing, and what is beyond m_p but not
// the clamp half. This is convex and piecewise quadratic: a few Newton steps from the projection
// serve, on every eighth pixel. docs/performance.md has what it gains.
// Immutable: any thread may call.
class DistanceFit {
 public:
  static constexpr float kEdgeWidth = 0.05f;  // radians

  // Keeps a copy of what it needs. REQUIRES: basis.pixels = resolution^2.
  DistanceFit(const DistanceBasis& basis, std::uint32_t resolution);

  // Coefficients [images, components] of images as visibility_bits() returns them, one after the
  // other. The same bytes whether the processor has AVX-512 or not.
  [[nodiscard]] std::vector<float> coefficients(std::span<const std::uint8_t> images) const;

 private:
  struct Work;  // on one image
  void measure(std::span<const std::uint8_t> image, Work& work) const;
  void project(Work& work) const;
  std::size_t gather(Work& work) const;
  void step(std::size_t rows, Work& work) const;

  std::uint32_t resolution_;
  std::uint32_t row_step_;     // one row of so many is looked at,
  std::uint32_t column_step_;  // in it one column of so many, another one in the next
  std::size_t components_;
  std::size_t padded_;  // components, to a multiple of sixteen
  bool wide_;
  DistanceTransform transform_;
  std::vector<std::uint32_t> points_;  // pixels that are looked at, padded to a multiple of eight
  std::vector<float> mean_;            // [points]
  std::vector<float> by_point_;        // [points, padded] the components
  std::vector<float> by_component_;    // [components, points]
};

// How many pixels of the images have another sign in mean + sum of c_i component_i than in
// `images`. `coefficients` [images, components].
[[nodiscard]] std::uint64_t wrong_signs(const DistanceBasis& basis,
                                        std::span<const std::uint8_t> images,
                                        std::span<const float> coefficients);

}  // namespace weft::transport
