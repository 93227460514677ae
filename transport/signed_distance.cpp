#include "transport/signed_distance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include <immintrin.h>

#include "core/check.h"
#include "transport/sphere.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

constexpr float kNone = 1e9f;  // larger than any 1 - cos, however small the sines it is scaled by
constexpr float kNoLimit = 2.5f;  // larger than any 1 - cos of real distances
constexpr std::size_t kMaxResolution = 1024;
constexpr std::size_t kWideLanes = 16;
constexpr std::size_t kLanes = 8;
constexpr float kHalfRoot = 0.70710678f;

// An image while its rows are compared. `nearest` holds, for every pixel, 1 - cos of the azimuth to
// the nearest pixel of its own row with the opposite value, negative where the pixel is blocked:
// seen from a pixel of the other value in the same column, that row is no columns away.
struct Image {
  const float* nearest;     // [rows, columns]
  const float* rows_apart;  // as DistanceTransform's
  const float* sine;
  std::size_t resolution;
  float limit;
  float limit_chord;
};

// Coefficients of asin(x) = x + x^3 p(x^2), 0 <= x <= sqrt(1/2), those of shading/fibre_angle.h.
constexpr float kArcSine[] = {0.111960903f,  -0.0940462798f, 0.0782289207f, 0.0158279035f,
                              0.0466362163f, 0.0748684704f,  0.166669935f};

// h improved by a row that lies `gap` = 2 sin^2(dtheta / 2) away; `flip` holds the sign bits of the
// pixels' own values.
__m256 improved(__m256 best, __m256 gap, float scale, const float* nearest, __m256 flip) {
  const __m256 around =
      _mm256_max_ps(_mm256_xor_ps(_mm256_loadu_ps(nearest), flip), _mm256_setzero_ps());
  return _mm256_min_ps(best, _mm256_add_ps(gap, _mm256_mul_ps(_mm256_set1_ps(scale), around)));
}

// The angle d with 1 - cos d = h, from the sine of d / 2 or of its complement.
__m256 angle_of(__m256 h, const Image& image) {
  const __m256 beyond = _mm256_sub_ps(_mm256_set1_ps(2), h);
  const __m256 half = _mm256_mul_ps(_mm256_set1_ps(0.5f),
                                    _mm256_max_ps(_mm256_min_ps(h, beyond), _mm256_setzero_ps()));
  const __m256 x = _mm256_min_ps(_mm256_sqrt_ps(half), _mm256_set1_ps(kHalfRoot));
  const __m256 z = _mm256_mul_ps(x, x);
  __m256 p = _mm256_set1_ps(kArcSine[0]);
  for (std::size_t i = 1; i < std::size(kArcSine); ++i) {
    p = _mm256_add_ps(_mm256_set1_ps(kArcSine[i]), _mm256_mul_ps(z, p));
  }
  const __m256 arc = _mm256_add_ps(x, _mm256_mul_ps(_mm256_mul_ps(x, z), p));
  const __m256 acute = _mm256_add_ps(arc, arc);
  const __m256 obtuse = _mm256_sub_ps(_mm256_set1_ps(std::numbers::pi_v<float>), acute);
  const __m256 angle =
      _mm256_blendv_ps(obtuse, acute, _mm256_cmp_ps(h, _mm256_set1_ps(1), _CMP_LT_OQ));
  return _mm256_blendv_ps(angle, _mm256_set1_ps(image.limit),
                          _mm256_cmp_ps(h, _mm256_set1_ps(image.limit_chord), _CMP_GE_OQ));
}

// With h = 1 - cos d, the pixels of rows theta and theta' have
// h = 2 sin^2(dtheta / 2) + sin theta sin theta' 2 sin^2(dphi / 2), free of cancellation. On one
// row h grows with |dphi|, so only the nearest opposite column of each row can win; rows whose
// first term is no less than the worst h of the columns at hand cannot.
void measure_columns(const Image& image, std::size_t row, std::size_t column, float* distances) {
  const std::size_t n = image.resolution;
  const float* here = image.nearest + row * n + column;
  const __m256 flip = _mm256_and_ps(_mm256_loadu_ps(here), _mm256_set1_ps(-0.0f));
  const float sine = image.sine[row];
  __m256 h =
      improved(_mm256_set1_ps(image.limit_chord), _mm256_setzero_ps(), sine * sine, here, flip);
  const std::size_t furthest = std::max(row, n - 1 - row);
  for (std::size_t k = 1; k <= furthest; ++k) {
    const __m256 gap = _mm256_set1_ps(image.rows_apart[k]);
    if (_mm256_movemask_ps(_mm256_cmp_ps(gap, h, _CMP_LT_OQ)) == 0) {
      break;
    }
    if (k <= row) {
      h = improved(h, gap, sine * image.sine[row - k], here - k * n, flip);
    }
    if (row + k < n) {
      h = improved(h, gap, sine * image.sine[row + k], here + k * n, flip);
    }
  }
  _mm256_storeu_ps(distances, _mm256_xor_ps(angle_of(h, image), flip));
}

// The same, operation by operation, for sixteen columns.
WEFT_WIDE __m512 improved_wide(__m512 best, __m512 gap, float scale, const float* nearest,
                               __m512 flip) {
  const __m512 around = _mm512_maskz_max_ps(0xffff, _mm512_xor_ps(_mm512_loadu_ps(nearest), flip),
                                            _mm512_setzero_ps());
  const __m512 h = _mm512_add_ps(gap, _mm512_mul_ps(_mm512_set1_ps(scale), around));
  return _mm512_maskz_min_ps(0xffff, best, h);
}

WEFT_WIDE __m512 angle_of_wide(__m512 h, const Image& image) {
  const __m512 beyond = _mm512_sub_ps(_mm512_set1_ps(2), h);
  const __m512 half = _mm512_mul_ps(
      _mm512_set1_ps(0.5f),
      _mm512_maskz_max_ps(0xffff, _mm512_maskz_min_ps(0xffff, h, beyond), _mm512_setzero_ps()));
  const __m512 x =
      _mm512_maskz_min_ps(0xffff, _mm512_maskz_sqrt_ps(0xffff, half), _mm512_set1_ps(kHalfRoot));
  const __m512 z = _mm512_mul_ps(x, x);
  __m512 p = _mm512_set1_ps(kArcSine[0]);
  for (std::size_t i = 1; i < std::size(kArcSine); ++i) {
    p = _mm512_add_ps(_mm512_set1_ps(kArcSine[i]), _mm512_mul_ps(z, p));
  }
  const __m512 arc = _mm512_add_ps(x, _mm512_mul_ps(_mm512_mul_ps(x, z), p));
  const __m512 acute = _mm512_add_ps(arc, arc);
  const __m512 obtuse = _mm512_sub_ps(_mm512_set1_ps(std::numbers::pi_v<float>), acute);
  const __m512 angle =
      _mm512_mask_blend_ps(_mm512_cmp_ps_mask(h, _mm512_set1_ps(1), _CMP_LT_OQ), obtuse, acute);
  return _mm512_mask_blend_ps(_mm512_cmp_ps_mask(h, _mm512_set1_ps(image.limit_chord), _CMP_GE_OQ),
                              angle, _mm512_set1_ps(image.limit));
}

WEFT_WIDE void measure_columns_wide(const Image& image, std::size_t row, std::size_t column,
                                    float* distances) {
  const std::size_t n = image.resolution;
  const float* here = image.nearest + row * n + column;
  const __m512 flip = _mm512_and_ps(_mm512_loadu_ps(here), _mm512_set1_ps(-0.0f));
  const float sine = image.sine[row];
  __m512 h = improved_wide(_mm512_set1_ps(image.limit_chord), _mm512_setzero_ps(), sine * sine,
                           here, flip);
  const std::size_t furthest = row > n - 1 - row ? row : n - 1 - row;
  for (std::size_t k = 1; k <= furthest; ++k) {
    const __m512 gap = _mm512_set1_ps(image.rows_apart[k]);
    if (_mm512_cmp_ps_mask(gap, h, _CMP_LT_OQ) == 0) {
      break;
    }
    if (k <= row) {
      h = improved_wide(h, gap, sine * image.sine[row - k], here - k * n, flip);
    }
    if (row + k < n) {
      h = improved_wide(h, gap, sine * image.sine[row + k], here + k * n, flip);
    }
  }
  _mm512_storeu_ps(distances, _mm512_xor_ps(angle_of_wide(h, image), flip));
}

// Writes the part of a row that lies between two edges, round the circle: `length` pixels from
// `first` on, whose neighbours at both ends have the other value.
void fill_run(std::size_t first, std::size_t length, float sign, std::span<const float> chord,
              std::span<float> row) {
  for (std::size_t i = 0; i < length; ++i) {
    const std::size_t at = first + i < row.size() ? first + i : first + i - row.size();
    row[at] = sign * chord[std::min(i + 1, length - i)];
  }
}

}  // namespace

DistanceTransform::DistanceTransform(std::uint32_t resolution, float limit)
    : resolution_(resolution),
      limit_(limit),
      limit_chord_(limit < std::numbers::pi_v<float>
                       ? static_cast<float>(2 * std::pow(std::sin(limit / 2.0), 2))
                       : kNoLimit),
      wide_(wide_is_available()),
      rows_apart_(resolution),
      columns_apart_(resolution),
      sine_(resolution) {
  CHECK_LE(resolution, kMaxResolution);
  CHECK_EQ(resolution % kLanes, 0U);
  for (std::uint32_t i = 0; i < resolution; ++i) {
    const double step = std::numbers::pi / resolution * i;
    rows_apart_[i] = static_cast<float>(2 * std::pow(std::sin(step / 2), 2));
    columns_apart_[i] = static_cast<float>(2 * std::pow(std::sin(step), 2));
    sine_[i] = static_cast<float>(std::sin(row_theta(i, resolution)));
  }
}

void DistanceTransform::nearest_in_row(std::span<const std::uint8_t> bits,
                                       std::span<float> row) const {
  const std::size_t n = row.size();
  std::size_t first_edge = n;
  std::size_t last_edge = 0;
  unsigned before = bits[n / 8 - 1] >> 7;  // the pixel before, round the circle
  for (std::size_t b = 0; b < n / 8; ++b) {
    const unsigned byte = bits[b];
    for (unsigned edges = (byte ^ (byte << 1 | before)) & 0xffU; edges != 0; edges &= edges - 1) {
      const std::size_t edge = 8 * b + static_cast<std::size_t>(std::countr_zero(edges));
      if (first_edge == n) {
        first_edge = edge;
      } else {  // the run that ends here has the value that does not begin here
        const bool begins_visible = (byte >> (edge % 8) & 1U) != 0;
        fill_run(last_edge, edge - last_edge, begins_visible ? -1.0f : 1.0f, columns_apart_, row);
      }
      last_edge = edge;
    }
    before = byte >> 7;
  }
  const float sign = before != 0 ? 1.0f : -1.0f;  // of the run over the seam
  if (first_edge == n) {
    std::fill(row.begin(), row.end(), sign * kNone);
  } else {
    fill_run(last_edge, first_edge + n - last_edge, sign, columns_apart_, row);
  }
}

void DistanceTransform::measure(std::span<const std::uint8_t> bits, std::uint32_t row_step,
                                std::span<float> distances) const {
  const std::size_t n = resolution_;
  CHECK_EQ(bits.size(), n * n / 8);
  CHECK_EQ(distances.size(), (n + row_step - 1) / row_step * n);
  std::vector<float> nearest(n * n);
  for (std::size_t r = 0; r < n; ++r) {
    nearest_in_row(bits.subspan(r * n / 8, n / 8), std::span(nearest).subspan(r * n, n));
  }
  const Image image{nearest.data(), rows_apart_.data(), sine_.data(), n, limit_, limit_chord_};
  float* to = distances.data();
  for (std::size_t r = 0; r < n; r += row_step, to += n) {
    std::size_t c = 0;
    for (; wide_ && c + kWideLanes <= n; c += kWideLanes) {
      measure_columns_wide(image, r, c, to + c);
    }
    for (; c < n; c += kLanes) {
      measure_columns(image, r, c, to + c);
    }
  }
}

std::vector<float> signed_distance(std::span<const std::uint8_t> bits, std::uint32_t resolution) {
  std::vector<float> distances(std::size_t{resolution} * resolution);
  DistanceTransform(resolution).measure(bits, distances);
  return distances;
}

void correct_pixel_bias(std::span<float> distances, std::uint32_t resolution) {
  const float bias = pixel_bias(resolution);
  for (float& d : distances) {
    const float size = std::abs(d);
    if (size < std::numbers::pi_v<float>) {
      d = std::copysign(size - std::min(bias, size / 2), d);
    }
  }
}

}  // namespace weft::transport
