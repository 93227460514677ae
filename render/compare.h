#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "render/image.h"

namespace weft::render {

// How a picture differs from a reference, per channel, over the pixels that are finite in both.
struct Comparison {
  glm::dvec3 mean{0, 0, 0};
  glm::dvec3 reference_mean{0, 0, 0};
  glm::dvec3 rmse{0, 0, 0};
  double rmse_all = 0;  // over all channels together
  glm::dvec3 largest_difference{0, 0, 0};
  // (mean - reference mean) / reference mean; nothing where the reference is black.
  std::optional<double> relative_mean_error[3];
  std::uint64_t pixels = 0;             // that were compared
  std::uint64_t non_finite_pixels = 0;  // that were left out
};

// Throws core::Error(kInvalidArgument) when the pictures are not of the same size, or no pixel is
// finite in both.
[[nodiscard]] Comparison compare(const Image& image, const Image& reference);

// The difference as 8-bit sRGB, row-major: black where the pictures agree, red where `image` is
// brighter than `reference`, blue where it is darker, full at `full_scale` of difference in mean of
// the channels. Pixels that are not finite are green. REQUIRES: full_scale > 0 and equal sizes.
[[nodiscard]] std::vector<std::uint8_t> difference_picture(const Image& image,
                                                           const Image& reference,
                                                           double full_scale);

// A scale that leaves one pixel in a hundred at its end; 1 when the pictures are equal.
[[nodiscard]] double natural_scale(const Image& image, const Image& reference);

}  // namespace weft::render
