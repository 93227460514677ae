#include "transport/ball_regions.h"

#include <cmath>
#include <numbers>

#include "shading/fibre_angle.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
// Widens regions by more than the polynomials and the rounding of float are off.
constexpr float kMargin = 1e-4f;
constexpr float kTiny = 1e-30f;  // keeps quotients finite; far below any fibre's square

// The angle of the point (c, s) of the unit circle's first quadrant.
[[gnu::always_inline]] inline float acute_angle(float s, float c) {
  const float least = s < c ? s : c;
  const float angle = shading::asin_acute(least < 0.70710678f ? least : 0.70710678f);
  return s < c ? angle : 0.5f * kPi - angle;
}

// At least asin(s), for s in [0, 1], and pi / 2 beyond: three terms of its series and the sum of
// all others at 1, which grow no slower than the next.
[[gnu::always_inline]] inline float arc_sine_bound(float s) {
  const float sine = s < 1 ? s : 1.0f;
  const float z = sine * sine;
  float p = 15.0f / 336 + z * 0.28451f;
  p = 3.0f / 40 + z * p;
  p = 1.0f / 6 + z * p;
  return sine + sine * z * p;
}

// No branches: compilers make vectors of the loop.
[[gnu::always_inline]] inline void bound_lanes(const Balls& balls, glm::vec3 shift, std::int32_t n,
                                               BallRegions& regions) {
  const float rows_per_radian = static_cast<float>(n) / kPi;
  const float columns_per_radian = 0.5f * rows_per_radian;
  const auto last = static_cast<float>(n - 1);
  for (std::size_t i = 0; i < Balls::kCount; ++i) {
    const float x = balls.x[i] + shift.x;
    const float y = balls.y[i] + shift.y;
    const float z = balls.z[i] + shift.z;
    const float radius = balls.radius[i];
    const float across2 = x * x + y * y;
    const float distance2 = across2 + z * z;
    const float across = std::sqrt(across2 + kTiny);
    const float distance = std::sqrt(distance2 + kTiny);
    const float per_across = 1 / across;
    const float per_distance = 1 / distance;
    const float elevation = acute_angle(across * per_distance, std::abs(z) * per_distance);
    const float theta = z > 0 ? elevation : kPi - elevation;
    const float alpha = arc_sine_bound(radius * per_distance) + kMargin;
    const bool inside = distance <= 1.0001f * radius;
    const float top = std::ceil((theta - alpha) * rows_per_radian - 0.5f);
    const float bottom = std::floor((theta + alpha) * rows_per_radian - 0.5f);
    // sin(dphi) = sin(alpha) / sin(theta) bounds the azimuths of a cap; the margin grows likewise.
    const float turn = acute_angle(std::abs(y) * per_across, std::abs(x) * per_across);
    const float half = x > 0 ? turn : kPi - turn;
    const float phi = y > 0 ? half : 2 * kPi - half;
    const float spread =
        arc_sine_bound(radius * per_across) + kMargin * (1 + distance * per_across);
    const float width = spread < kPi ? spread : kPi;
    const float left = std::ceil((phi - width) * columns_per_radian - 0.5f);
    const float right = std::floor((phi + width) * columns_per_radian - 0.5f);
    const bool round =
        inside | (across <= 1.0001f * radius) | (theta - alpha <= 0) | (theta + alpha >= kPi);
    regions.distance2[i] = distance2;
    regions.first_row[i] = static_cast<std::int32_t>(inside || top < 0 ? 0.0f : top);
    regions.last_row[i] = static_cast<std::int32_t>(inside || bottom > last ? last : bottom);
    regions.first_column[i] = static_cast<std::int32_t>(round ? 0.0f : left);
    regions.last_column[i] =
        static_cast<std::int32_t>(round ? last : (right < left + last ? right : left + last));
  }
}

void bound_portable(const Balls& balls, glm::vec3 shift, std::int32_t n, BallRegions& regions) {
  bound_lanes(balls, shift, n, regions);
}

WEFT_WIDE void bound_wide(const Balls& balls, glm::vec3 shift, std::int32_t n,
                          BallRegions& regions) {
  bound_lanes(balls, shift, n, regions);
}

}  // namespace

void bound(const Balls& balls, glm::vec3 shift, std::uint32_t resolution, bool wide,
           BallRegions& regions) {
  const auto n = static_cast<std::int32_t>(resolution);
  if (wide) {
    bound_wide(balls, shift, n, regions);
  } else {
    bound_portable(balls, shift, n, regions);
  }
}

}  // namespace weft::transport
