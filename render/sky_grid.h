#pragma once

#include <cstddef>
#include <vector>

#include <glm/vec3.hpp>

#include "render/image.h"
#include "shading/spherical_harmonics.h"

namespace weft::render {

// A picture in latitude and longitude as cloth sees it: smoothed by a spherical Gaussian a few
// degrees wide, on the bins of a fixed grid that serve as a quadrature over directions. These are
// directions of a picture that is not turned (environment.h).
struct SkyGrid {
  static constexpr std::size_t kRows = 128;
  static constexpr std::size_t kColumns = 256;
  static constexpr double kBin = 3.14159265358979323846 / kRows;  // radians, at the horizon
  static constexpr double kSmoothing = 400;  // sharpness of the Gaussian: three degrees

  std::size_t rows = 0;  // kRows, or half as many: those above the horizon
  std::vector<glm::vec3> directions;
  std::vector<float> solid_angles;
  std::vector<glm::vec3> radiance;
  std::vector<shading::ShVector> harmonics;  // of the directions, times the solid angles
};

[[nodiscard]] SkyGrid make_sky_grid(const Image& picture, bool upper_half);

// The bins of whole rows outside which a spherical Gaussian stays below exp(-16), and the cosine to
// its axis at which it falls to that.
struct SkyBins {
  std::size_t first;
  std::size_t last;
  float least_cosine;
};
[[nodiscard]] SkyBins bins_about(const SkyGrid& grid, const glm::vec3& axis, double sharpness);

}  // namespace weft::render
