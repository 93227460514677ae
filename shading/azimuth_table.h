#pragma once

#include <cstdint>
#include <vector>

namespace weft::shading {

// Samples the azimuthal lobe of transmission, a von Mises density exp(kappa cos v) about v = 0, by
// inverting a piecewise linear density through knots of the exact one. density() is exactly what
// sample() draws from, so that estimators that divide by it stay unbiased. Immutable.
class AzimuthTable {
 public:
  // REQUIRES: kappa >= 0.
  explicit AzimuthTable(double kappa);

  struct Sample {
    float v;        // -pi ... pi
    float density;  // per radian, over the whole circle
  };
  // u in [0, 1).
  [[nodiscard]] Sample sample(float u) const;
  [[nodiscard]] float density(float v) const;

 private:
  static constexpr int kCells = 512;

  std::vector<float> density_;        // [kCells + 1] at v = pi k / kCells, over 0 ... pi
  std::vector<float> cumulative_;     // [kCells + 1], 0 to 1
  std::vector<std::uint16_t> guide_;  // [kCells + 1]: last knot with cumulative <= j / kCells
};

}  // namespace weft::shading
