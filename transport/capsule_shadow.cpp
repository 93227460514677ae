#include "transport/capsule_shadow.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>
#include <immintrin.h>

#include "shading/fibre_angle.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
// Widens rectangles by more than the polynomials and the rounding of float are off.
constexpr float kMargin = 1e-4f;

// The angle of the point (c, s) of the unit circle's first quadrant.
float acute_angle(float s, float c) {
  const float angle = shading::asin_acute(std::min(std::min(s, c), 0.70710678f));
  return s < c ? angle : 0.5f * kPi - angle;
}

// asin over [0, 1].
float arc_sine(float s) { return acute_angle(s, std::sqrt(std::max(0.0f, 1 - s * s))); }

std::uint64_t ones(std::int32_t first, std::int32_t last) {  // bits of one word, clipped to it
  first = std::max(first, 0);
  last = std::min(last, 63);
  return first > last ? 0 : ~std::uint64_t{0} >> (63 - (last - first)) << first;
}

// Columns first ... last, which may run over the seam at phi = 0.
void set_columns(ImageRegion& region, std::int32_t first, std::int32_t last, std::int32_t n) {
  const std::int32_t turn = first < 0 ? n : (last >= n ? -n : 0);
  for (std::int32_t w = 0; 64 * w < n; ++w) {
    const std::uint64_t word = ones(first - 64 * w, last - 64 * w) |
                               (turn == 0 ? 0 : ones(first + turn - 64 * w, last + turn - 64 * w));
    region.columns[static_cast<std::size_t>(w)] = word & ones(-64 * w, n - 1 - 64 * w);
  }
}

// What hides a direction d, in terms of p = d.u, q = d.e1, w = d.e2, where u is the axis, e1 points
// from the origin to the axis' line and e2 = u x e1; the ends A, B are (s_a, h, 0), (s_b, h, 0).
// Ball A: |d x A|^2 = w^2 |A|^2 + (p h - q s_a)^2 < r^2 and d.A > 0; no difference of large
// numbers. Between: the planes through the origin that touch both balls have normals (r/h) e1 +-
// sqrt(1 - r^2/h^2) e2, hence w^2 (h^2 - r^2) < r^2 q^2 and q > 0; those through the points where
// they touch ball A are normal to k u - s_a e1 with k = h - r^2/h, hence s_a q < k p < s_b q.
struct Shadow {
  glm::vec3 u;
  glm::vec3 e1;
  glm::vec3 e2;
  float h;
  float k;
  float s_a;
  float s_b;
  float a2;
  float b2;
  float r2;
  float tangent2;  // h^2 - r^2; not positive: one ball hides the rest, there is no quadrilateral
};

Shadow shadow_of(const SeenCapsule& capsule) {
  Shadow s{};
  s.u = capsule.axis;
  s.s_a = glm::dot(capsule.start, s.u);
  s.s_b = s.s_a + capsule.length;
  glm::vec3 across = capsule.start - s.s_a * s.u;
  s.h = glm::length(across);
  s.r2 = capsule.radius * capsule.radius;
  if (s.h < 1e-3f * capsule.radius) {  // the axis runs through the origin: any direction serves
    across = std::abs(s.u.x) < 0.7f ? glm::vec3{1, 0, 0} : glm::vec3{0, 1, 0};
    across -= glm::dot(across, s.u) * s.u;
  }
  s.e1 = glm::normalize(across);
  s.e2 = glm::cross(s.u, s.e1);
  s.k = s.h > 0 ? s.h - s.r2 / s.h : 0;
  s.a2 = s.s_a * s.s_a + s.h * s.h;
  s.b2 = s.s_b * s.s_b + s.h * s.h;
  s.tangent2 = s.h * s.h - s.r2;
  return s;
}

// d . axis for eight columns of a row.
struct RowAxis {
  RowAxis(glm::vec3 axis, float sin_theta, float cos_theta)
      : x(_mm256_set1_ps(axis.x * sin_theta)),
        y(_mm256_set1_ps(axis.y * sin_theta)),
        z(_mm256_set1_ps(axis.z * cos_theta)) {}
  [[nodiscard]] __m256 dot(__m256 cos_phi, __m256 sin_phi) const {
    return _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(x, cos_phi), _mm256_mul_ps(y, sin_phi)), z);
  }
  __m256 x;
  __m256 y;
  __m256 z;
};

__m256 less(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_LT_OQ); }

__m256 in_ball(const Shadow& s, float s_end, float end2, const __m256 (&pqw2)[3]) {
  const __m256 h = _mm256_set1_ps(s.h);
  const __m256 end = _mm256_set1_ps(s_end);
  const __m256 off = _mm256_sub_ps(_mm256_mul_ps(pqw2[0], h), _mm256_mul_ps(pqw2[1], end));
  const __m256 distance2 =
      _mm256_add_ps(_mm256_mul_ps(pqw2[2], _mm256_set1_ps(end2)), _mm256_mul_ps(off, off));
  const __m256 ahead = _mm256_add_ps(_mm256_mul_ps(pqw2[0], end), _mm256_mul_ps(pqw2[1], h));
  return _mm256_and_ps(less(distance2, _mm256_set1_ps(s.r2)), less(_mm256_setzero_ps(), ahead));
}

__m256 between_balls(const Shadow& s, const __m256 (&pqw2)[3]) {
  const __m256 q = pqw2[1];
  const __m256 kp = _mm256_mul_ps(_mm256_set1_ps(s.k), pqw2[0]);
  const __m256 inside_planes = less(_mm256_mul_ps(pqw2[2], _mm256_set1_ps(s.tangent2)),
                                    _mm256_mul_ps(_mm256_set1_ps(s.r2), _mm256_mul_ps(q, q)));
  const __m256 beyond_a = less(_mm256_mul_ps(_mm256_set1_ps(s.s_a), q), kp);
  const __m256 before_b = less(kp, _mm256_mul_ps(_mm256_set1_ps(s.s_b), q));
  return _mm256_and_ps(_mm256_and_ps(inside_planes, less(_mm256_setzero_ps(), q)),
                       _mm256_and_ps(beyond_a, before_b));
}

// The eight pixels of a row from column `first` on: bit i for column first + i.
struct RowShadow {
  RowShadow(const Shadow& shadow_in, float sin_theta, float cos_theta)
      : shadow(shadow_in),
        u(shadow_in.u, sin_theta, cos_theta),
        e1(shadow_in.e1, sin_theta, cos_theta),
        e2(shadow_in.e2, sin_theta, cos_theta) {}
  [[nodiscard]] std::uint64_t eight(const SphereGrid& grid, std::size_t first) const {
    const __m256 cos_phi = _mm256_loadu_ps(&grid.cos_phi[first]);
    const __m256 sin_phi = _mm256_loadu_ps(&grid.sin_phi[first]);
    const __m256 w = e2.dot(cos_phi, sin_phi);
    const __m256 pqw2[3] = {u.dot(cos_phi, sin_phi), e1.dot(cos_phi, sin_phi), _mm256_mul_ps(w, w)};
    __m256 hidden = _mm256_or_ps(in_ball(shadow, shadow.s_a, shadow.a2, pqw2),
                                 in_ball(shadow, shadow.s_b, shadow.b2, pqw2));
    if (shadow.tangent2 > 0) {
      hidden = _mm256_or_ps(hidden, between_balls(shadow, pqw2));
    }
    return static_cast<std::uint64_t>(static_cast<unsigned>(_mm256_movemask_ps(hidden)));
  }
  const Shadow& shadow;
  RowAxis u;
  RowAxis e1;
  RowAxis e2;
};

}  // namespace

SphereGrid::SphereGrid(std::uint32_t resolution_in) : resolution(resolution_in) {
  for (std::uint32_t i = 0; i < resolution; ++i) {
    sin_theta.push_back(static_cast<float>(std::sin(row_theta(i, resolution))));
    cos_theta.push_back(static_cast<float>(std::cos(row_theta(i, resolution))));
    sin_phi.push_back(static_cast<float>(std::sin(column_phi(i, resolution))));
    cos_phi.push_back(static_cast<float>(std::cos(column_phi(i, resolution))));
  }
}

bool holds_origin(const SeenCapsule& capsule) {
  const float nearest = std::clamp(-glm::dot(capsule.start, capsule.axis), 0.0f, capsule.length);
  const glm::vec3 off = capsule.start + nearest * capsule.axis;
  return glm::dot(off, off) < capsule.radius * capsule.radius;
}

bool find_open_region(glm::vec3 centre, float radius, const CoverMask& mask, ImageRegion& region) {
  const auto n = static_cast<std::int32_t>(mask.resolution());
  const float across2 = centre.x * centre.x + centre.y * centre.y;
  const float distance = std::sqrt(across2 + centre.z * centre.z);
  if (distance <= 1.0001f * radius) {
    region.first_row = 0;
    region.last_row = n - 1;
    set_columns(region, 0, n - 1, n);
    return !mask.is_covered(region);
  }
  const float across = std::sqrt(across2);
  const float elevation = acute_angle(across / distance, std::abs(centre.z) / distance);
  const float theta = centre.z > 0 ? elevation : kPi - elevation;
  const float alpha = arc_sine(std::min(1.0f, radius / distance)) + kMargin;
  const float rows_per_radian = static_cast<float>(n) / kPi;
  region.first_row =
      std::max(0, static_cast<std::int32_t>(std::ceil((theta - alpha) * rows_per_radian - 0.5f)));
  region.last_row = std::min(
      n - 1, static_cast<std::int32_t>(std::floor((theta + alpha) * rows_per_radian - 0.5f)));
  region.first_row = mask.next_open_row(region.first_row, region.last_row);
  if (region.first_row < 0) {
    return false;  // most balls end here in dense cloth
  }
  if (across <= 1.0001f * radius || theta - alpha <= 0 || theta + alpha >= kPi) {
    set_columns(region, 0, n - 1, n);
    return !mask.is_covered(region);
  }
  const float turn = acute_angle(std::abs(centre.y) / across, std::abs(centre.x) / across);
  const float half = centre.x > 0 ? turn : kPi - turn;
  const float phi = centre.y > 0 ? half : 2 * kPi - half;
  // sin(dphi) = sin(alpha) / sin(theta) bounds the azimuths of a cap; the margin grows likewise.
  const float width = arc_sine(std::min(1.0f, radius / across)) + kMargin * (1 + distance / across);
  const float columns_per_radian = 0.5f * rows_per_radian;
  const auto first =
      static_cast<std::int32_t>(std::ceil((phi - width) * columns_per_radian - 0.5f));
  const auto last =
      static_cast<std::int32_t>(std::floor((phi + width) * columns_per_radian - 0.5f));
  if (first > last) {
    return false;
  }
  set_columns(region, first, std::min(last, first + n - 1), n);
  return !mask.is_covered(region);
}

void paint(const SeenCapsule& capsule, const ImageRegion& region, const SphereGrid& grid,
           CoverMask& mask) {
  const Shadow shadow = shadow_of(capsule);
  for (std::int32_t r = mask.next_open_row(region.first_row, region.last_row); r >= 0;
       r = mask.next_open_row(r + 1, region.last_row)) {
    const auto row = static_cast<std::uint32_t>(r);
    const RowShadow in_row(shadow, grid.sin_theta[row], grid.cos_theta[row]);
    std::uint64_t* bits = mask.row(row);
    for (std::size_t w = 0; w < mask.words(); ++w) {
      for (std::uint64_t open = ~bits[w] & region.columns[w]; open != 0;) {
        const int byte = std::countr_zero(open) / 8;
        bits[w] |= in_row.eight(grid, 64 * w + 8 * static_cast<std::size_t>(byte)) << (8 * byte);
        open &= ~(std::uint64_t{0xff} << (8 * byte));
      }
    }
    mask.close_if_full(row);
  }
}

}  // namespace weft::transport
