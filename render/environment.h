#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "render/image.h"

namespace weft::render {

// Light from everywhere at infinity, piecewise constant over the pixels of a picture in latitude
// and longitude: top row at +z, middle column at +y, to its right +x. Sampled by luminance times
// solid angle. Immutable: any thread may call.
class Environment {
 public:
  // `scale` multiplies the radiance; `turn` (radians) turns the picture counterclockwise about z.
  // Negative and non-finite radiance counts as black. Throws core::Error(kInvalidArgument) when the
  // whole picture is black.
  Environment(const Image& picture, glm::vec3 scale, double turn);

  [[nodiscard]] glm::vec3 radiance(const glm::dvec3& direction) const;
  [[nodiscard]] glm::dvec3 sample(double u1, double u2) const;
  [[nodiscard]] double pdf(const glm::dvec3& direction) const;

  // The picture, scaled and without what counts as black; it is not turned.
  [[nodiscard]] const Image& picture() const { return picture_; }
  [[nodiscard]] double turn() const { return turn_; }

 private:
  struct Pixel {
    std::uint32_t x;
    std::uint32_t y;
  };
  [[nodiscard]] Pixel pixel_of(const glm::dvec3& direction) const;
  // Solid angle of one pixel of row y.
  [[nodiscard]] double solid_angle(std::uint32_t y) const;

  Image picture_;
  double turn_ = 0;
  std::vector<double> row_cumulative_;    // [height + 1], up to the whole weight
  std::vector<double> pixel_cumulative_;  // [height, width + 1], up to the row's weight
};

}  // namespace weft::render
