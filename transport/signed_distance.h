#pragma once

#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

namespace weft::transport {

// Spherical signed distance of visibility images (Khungurn et al. 2017, section 4.1): for every
// pixel the angle, in radians, to the nearest pixel centre of the opposite value, positive where
// the sky is seen. Exact up to `limit`; what lies further is +limit or -limit, and so is everything
// when there is no opposite. A limit saves time: rows beyond it are not looked at.
// Immutable: any thread may call.
class DistanceTransform {
 public:
  // REQUIRES: resolution is a multiple of 8, at most 1024; 0 < limit <= pi.
  explicit DistanceTransform(std::uint32_t resolution, float limit = std::numbers::pi_v<float>);

  // `bits` as visibility_bits() returns them, `distances` [resolution^2]. The same bytes whether
  // the processor has AVX-512 or not.
  void measure(std::span<const std::uint8_t> bits, std::span<float> distances) const {
    measure(bits, 1, distances);
  }

  // The same for rows 0, row_step, 2 row_step ... alone: [rows so chosen, resolution].
  void measure(std::span<const std::uint8_t> bits, std::uint32_t row_step,
               std::span<float> distances) const;

 private:
  void nearest_in_row(std::span<const std::uint8_t> bits, std::span<float> row) const;

  std::uint32_t resolution_;
  float limit_;
  float limit_chord_;                 // 1 - cos limit; above all distances where the limit is pi
  bool wide_;                         // AVX-512 is there
  std::vector<float> rows_apart_;     // [resolution] 1 - cos of the angle between rows i apart
  std::vector<float> columns_apart_;  // [resolution] 1 - cos of an azimuth of i columns
  std::vector<float> sine_;           // [resolution] of each row's polar angle
};

// One image, without a limit.
[[nodiscard]] std::vector<float> signed_distance(std::span<const std::uint8_t> bits,
                                                 std::uint32_t resolution);

// The nearest opposite pixel centre lies about 0.6 pixels beyond the edge: moves every distance
// towards zero by min(0.6 pi / resolution, |d| / 2), never across it (near the poles pixels are
// much closer than that). Distances of pi, which see no edge, stay.
void correct_pixel_bias(std::span<float> distances, std::uint32_t resolution);

// By how much.
[[nodiscard]] inline float pixel_bias(std::uint32_t resolution) {
  return 0.6f * std::numbers::pi_v<float> / static_cast<float>(resolution);
}

}  // namespace weft::transport
