#include "transport/capsule_shadow.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <immintrin.h>

#include "transport/sphere.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

// What hides a direction d, in terms of p = d.u, q = d.e1, w = d.e2, where u is the axis, e1 points
// from the origin to the axis' line and e2 = u x e1; the ends A, B are (s_a, h, 0), (s_b, h, 0).
// Ball A: |d x A|^2 = w^2 |A|^2 + (p h - q s_a)^2 < r^2 and d.A > 0; no difference of large
// numbers. Between: the planes through the origin that touch both balls have normals (r/h) e1 +-
// sqrt(1 - r^2/h^2) e2, hence w^2 (h^2 - r^2) < r^2 q^2 and q > 0; those through the points where
// they touch ball A are normal to k u - s_a e1 with k = h - r^2/h, hence s_a q < k p < s_b q. The
// balls, too, lie within the first two planes, which most pixels of a region fail.
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

// With d = (sin(theta) cos(phi), sin(theta) sin(phi), cos(theta)), d . axis is sin(theta) times
// something of the column plus something of the row. This is the former, for the three axes.
struct Columns {
  std::array<float, kMaxMaskResolution> u;
  std::array<float, kMaxMaskResolution> e1;
  std::array<float, kMaxMaskResolution> e2;
};

void set_columns(const Shadow& shadow, const SphereGrid& grid, std::size_t first, std::size_t last,
                 Columns& columns) {
  for (std::size_t c = first; c <= last; ++c) {
    columns.u[c] = shadow.u.x * grid.cos_phi[c] + shadow.u.y * grid.sin_phi[c];
    columns.e1[c] = shadow.e1.x * grid.cos_phi[c] + shadow.e1.y * grid.sin_phi[c];
    columns.e2[c] = shadow.e2.x * grid.cos_phi[c] + shadow.e2.y * grid.sin_phi[c];
  }
}

// Eight rows: sin(theta) and cos(theta) times the axes' z.
struct Rows {
  __m256 sine;
  __m256 u;
  __m256 e1;
  __m256 e2;
};

__m256 dot(__m256 sine, float of_column, __m256 of_row) {
  return _mm256_add_ps(_mm256_mul_ps(sine, _mm256_set1_ps(of_column)), of_row);
}

__m256 less(__m256 a, __m256 b) { return _mm256_cmp_ps(a, b, _CMP_LT_OQ); }

__m256 in_ball(const Shadow& s, float s_end, float end2, __m256 p, __m256 q, __m256 w2) {
  const __m256 h = _mm256_set1_ps(s.h);
  const __m256 end = _mm256_set1_ps(s_end);
  const __m256 off = _mm256_sub_ps(_mm256_mul_ps(p, h), _mm256_mul_ps(q, end));
  const __m256 distance2 =
      _mm256_add_ps(_mm256_mul_ps(w2, _mm256_set1_ps(end2)), _mm256_mul_ps(off, off));
  const __m256 ahead = _mm256_add_ps(_mm256_mul_ps(p, end), _mm256_mul_ps(q, h));
  return _mm256_and_ps(less(distance2, _mm256_set1_ps(s.r2)), less(_mm256_setzero_ps(), ahead));
}

// Which of eight pixels of a column are hidden: bit i for the row that lane i holds.
std::uint64_t hidden(const Shadow& s, const Rows& rows, const Columns& columns,
                     std::size_t column) {
  const __m256 q = dot(rows.sine, columns.e1[column], rows.e1);
  const __m256 w = dot(rows.sine, columns.e2[column], rows.e2);
  const __m256 w2 = _mm256_mul_ps(w, w);
  __m256 may = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
  if (s.tangent2 > 0) {
    may = _mm256_and_ps(less(_mm256_setzero_ps(), q),
                        less(_mm256_mul_ps(w2, _mm256_set1_ps(s.tangent2)),
                             _mm256_mul_ps(_mm256_set1_ps(s.r2), _mm256_mul_ps(q, q))));
    if (_mm256_movemask_ps(may) == 0) {
      return 0;
    }
  }
  const __m256 p = dot(rows.sine, columns.u[column], rows.u);
  __m256 any = _mm256_or_ps(in_ball(s, s.s_a, s.a2, p, q, w2), in_ball(s, s.s_b, s.b2, p, q, w2));
  if (s.tangent2 > 0) {
    const __m256 kp = _mm256_mul_ps(_mm256_set1_ps(s.k), p);
    any = _mm256_or_ps(any, _mm256_and_ps(less(_mm256_mul_ps(_mm256_set1_ps(s.s_a), q), kp),
                                          less(kp, _mm256_mul_ps(_mm256_set1_ps(s.s_b), q))));
  }
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_and_ps(may, any)));
}

// The same, operation by operation, for sixteen rows.
struct WideRows {
  __m512 sine;
  __m512 u;
  __m512 e1;
  __m512 e2;
};

WEFT_WIDE inline __m512 dot(__m512 sine, float of_column, __m512 of_row) {
  return _mm512_add_ps(_mm512_mul_ps(sine, _mm512_set1_ps(of_column)), of_row);
}

WEFT_WIDE inline __mmask16 less(__mmask16 among, __m512 a, __m512 b) {
  return _mm512_mask_cmp_ps_mask(among, a, b, _CMP_LT_OQ);
}

WEFT_WIDE inline __mmask16 in_ball(__mmask16 may, const Shadow& s, float s_end, float end2,
                                   const __m512 (&pqw2)[3]) {
  const __m512 h = _mm512_set1_ps(s.h);
  const __m512 end = _mm512_set1_ps(s_end);
  const __m512 off = _mm512_sub_ps(_mm512_mul_ps(pqw2[0], h), _mm512_mul_ps(pqw2[1], end));
  const __m512 distance2 =
      _mm512_add_ps(_mm512_mul_ps(pqw2[2], _mm512_set1_ps(end2)), _mm512_mul_ps(off, off));
  const __m512 ahead = _mm512_add_ps(_mm512_mul_ps(pqw2[0], end), _mm512_mul_ps(pqw2[1], h));
  return less(less(may, distance2, _mm512_set1_ps(s.r2)), _mm512_setzero_ps(), ahead);
}

WEFT_WIDE inline std::uint64_t hidden(const Shadow& s, const WideRows& rows, float of_u,
                                      float of_e1, float of_e2) {
  const __m512 q = dot(rows.sine, of_e1, rows.e1);
  const __m512 w = dot(rows.sine, of_e2, rows.e2);
  const __m512 w2 = _mm512_mul_ps(w, w);
  __mmask16 may = 0xffff;
  if (s.tangent2 > 0) {
    may = less(less(may, _mm512_setzero_ps(), q), _mm512_mul_ps(w2, _mm512_set1_ps(s.tangent2)),
               _mm512_mul_ps(_mm512_set1_ps(s.r2), _mm512_mul_ps(q, q)));
    if (may == 0) {
      return 0;
    }
  }
  const __m512 pqw2[3] = {dot(rows.sine, of_u, rows.u), q, w2};
  std::uint32_t any = static_cast<std::uint32_t>(in_ball(may, s, s.s_a, s.a2, pqw2)) |
                      static_cast<std::uint32_t>(in_ball(may, s, s.s_b, s.b2, pqw2));
  if (s.tangent2 > 0) {
    const __m512 kp = _mm512_mul_ps(_mm512_set1_ps(s.k), pqw2[0]);
    any |= less(less(may, _mm512_mul_ps(_mm512_set1_ps(s.s_a), q), kp), kp,
                _mm512_mul_ps(_mm512_set1_ps(s.s_b), q));
  }
  return any;
}

// Rows `first` ... and columns first_column ... last_column of the image.
struct Strip {
  std::size_t first_row;
  std::size_t first_column;
  std::size_t last_column;
};

void paint_rows(const Shadow& shadow, const Columns& columns, const Strip& strip,
                const SphereGrid& grid, CoverMask& mask) {
  const __m256 cosine = _mm256_loadu_ps(&grid.cos_theta[strip.first_row]);
  const Rows rows{_mm256_loadu_ps(&grid.sin_theta[strip.first_row]),
                  _mm256_mul_ps(_mm256_set1_ps(shadow.u.z), cosine),
                  _mm256_mul_ps(_mm256_set1_ps(shadow.e1.z), cosine),
                  _mm256_mul_ps(_mm256_set1_ps(shadow.e2.z), cosine)};
  const std::size_t word = strip.first_row / 64;
  const std::size_t shift = strip.first_row % 64;
  for (std::size_t c = strip.first_column; c <= strip.last_column; ++c) {
    if ((mask.open_rows(word, c) >> shift & 0xffU) != 0) {
      mask.cover(word, c, hidden(shadow, rows, columns, c) << shift);
    }
  }
}

WEFT_WIDE void paint_rows_wide(const Shadow& shadow, const Columns& columns, const Strip& strip,
                               const SphereGrid& grid, CoverMask& mask) {
  const __m512 cosine = _mm512_loadu_ps(grid.cos_theta.data() + strip.first_row);
  const WideRows rows{_mm512_loadu_ps(grid.sin_theta.data() + strip.first_row),
                      _mm512_mul_ps(_mm512_set1_ps(shadow.u.z), cosine),
                      _mm512_mul_ps(_mm512_set1_ps(shadow.e1.z), cosine),
                      _mm512_mul_ps(_mm512_set1_ps(shadow.e2.z), cosine)};
  const std::size_t word = strip.first_row / 64;
  const std::size_t shift = strip.first_row % 64;
  for (std::size_t c = strip.first_column; c <= strip.last_column; ++c) {
    if ((mask.open_rows(word, c) >> shift & 0xffffU) != 0) {
      mask.cover(word, c,
                 hidden(shadow, rows, columns.u[c], columns.e1[c], columns.e2[c]) << shift);
    }
  }
}

}  // namespace

SphereGrid::SphereGrid(std::uint32_t resolution_in) : resolution(resolution_in) {
  for (std::uint32_t i = 0; i < resolution; ++i) {
    sin_theta.push_back(static_cast<float>(std::sin(row_theta(i, resolution))));
    cos_theta.push_back(static_cast<float>(std::cos(row_theta(i, resolution))));
    sin_phi.push_back(static_cast<float>(std::sin(column_phi(i, resolution))));
    cos_phi.push_back(static_cast<float>(std::cos(column_phi(i, resolution))));
  }
  sin_theta.resize((sin_theta.size() + 63) / 64 * 64);
  cos_theta.resize(sin_theta.size());
}

bool holds_origin(const SeenCapsule& capsule) {
  const float nearest = std::clamp(-glm::dot(capsule.start, capsule.axis), 0.0f, capsule.length);
  const glm::vec3 off = capsule.start + nearest * capsule.axis;
  return glm::dot(off, off) < capsule.radius * capsule.radius;
}

void paint(const SeenCapsule& capsule, const ImageRegion& region, const SphereGrid& grid, bool wide,
           CoverMask& mask) {
  const Shadow shadow = shadow_of(capsule);
  const std::size_t step = wide ? 16 : 8;
  const auto n = static_cast<std::int32_t>(grid.resolution);
  Columns columns;  // only what is asked for is set
  for (const std::int32_t turn : {0, n, -n}) {
    const std::int32_t first = std::max(region.first_column + turn, 0);
    const std::int32_t last = std::min(region.last_column + turn, n - 1);
    if (first > last) {
      continue;
    }
    Strip strip{0, static_cast<std::size_t>(first), static_cast<std::size_t>(last)};
    set_columns(shadow, grid, strip.first_column, strip.last_column, columns);
    auto row = static_cast<std::size_t>(region.first_row);
    for (; row <= static_cast<std::size_t>(region.last_row); row = strip.first_row + step) {
      strip.first_row = std::min(row, row / 64 * 64 + 64 - step);  // within a word of the mask
      if (wide) {
        paint_rows_wide(shadow, columns, strip, grid, mask);
      } else {
        paint_rows(shadow, columns, strip, grid, mask);
      }
    }
  }
}

}  // namespace weft::transport
