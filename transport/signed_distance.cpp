#include "transport/signed_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <glm/vec2.hpp>
#include <immintrin.h>

#include "core/check.h"
#include "shading/fibre_angle.h"
#include "transport/sphere.h"

namespace weft::transport {

namespace {

constexpr float kNone = 1e9f;  // larger than any 2 sin^2, however small the sines it is scaled by
constexpr std::size_t kLanes = 8;
constexpr std::uint32_t kBlocked = 0;
constexpr std::uint32_t kVisible = 0xffffffffU;  // a mask of vector registers
constexpr std::size_t kMaxResolution = 1024;

// For every pixel of one row, 2 sin^2(dphi / 2) to the nearest pixel of the row whose value is
// `wanted`, round the circle; kNone where there is none.
void nearest_in_row(std::span<const std::uint32_t> row, std::uint32_t wanted,
                    std::span<const float> chord_of_steps, std::span<float> nearest) {
  const auto n = static_cast<std::ptrdiff_t>(row.size());
  const std::ptrdiff_t first = std::find(row.begin(), row.end(), wanted) - row.begin();
  if (first == n) {
    std::fill(nearest.begin(), nearest.end(), kNone);
    return;
  }
  std::ptrdiff_t after = first + n;
  std::array<std::ptrdiff_t, kMaxResolution> to_right;
  for (std::ptrdiff_t c = n - 1; c >= 0; --c) {
    const auto at = static_cast<std::size_t>(c);
    after = row[at] == wanted ? c : after;
    to_right[at] = after - c;
  }
  std::ptrdiff_t before = first;
  for (std::ptrdiff_t c = n - 1; c >= first; --c) {
    if (row[static_cast<std::size_t>(c)] == wanted) {
      before = c - n;
      break;
    }
  }
  for (std::ptrdiff_t c = 0; c < n; ++c) {
    const auto at = static_cast<std::size_t>(c);
    before = row[at] == wanted ? c : before;
    nearest[at] = chord_of_steps[static_cast<std::size_t>(std::min(c - before, to_right[at]))];
  }
}

// What only the resolution decides.
struct Chords {
  explicit Chords(std::uint32_t resolution)
      : rows_apart(resolution), columns_apart(resolution), sine(resolution) {
    for (std::uint32_t i = 0; i < resolution; ++i) {
      const double step = std::numbers::pi / resolution * i;
      rows_apart[i] = static_cast<float>(2 * std::pow(std::sin(step / 2), 2));
      columns_apart[i] = static_cast<float>(2 * std::pow(std::sin(step), 2));
      sine[i] = static_cast<float>(std::sin(row_theta(i, resolution)));
    }
  }
  std::vector<float> rows_apart;     // 2 sin^2 of half the angle between rows i apart
  std::vector<float> columns_apart;  // the same of azimuths i columns apart
  std::vector<float> sine;           // of each row's polar angle
};

// best = min(best, gap + scale * nearest opposite); returns the largest best. Written in registers
// because compilers do not vectorise a maximum of floats.
float improve(std::span<const std::uint32_t> own, const float* blocked, const float* visible,
              glm::vec2 gap_and_scale, std::span<float> best) {
  const __m256 gap = _mm256_set1_ps(gap_and_scale.x);
  const __m256 scale = _mm256_set1_ps(gap_and_scale.y);
  __m256 worst = _mm256_setzero_ps();
  for (std::size_t c = 0; c < own.size(); c += kLanes) {
    const __m256 is_visible =
        _mm256_castsi256_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(&own[c])));
    const __m256 around =
        _mm256_blendv_ps(_mm256_loadu_ps(visible + c), _mm256_loadu_ps(blocked + c), is_visible);
    const __m256 h = _mm256_add_ps(gap, _mm256_mul_ps(scale, around));
    const __m256 better = _mm256_min_ps(h, _mm256_loadu_ps(&best[c]));
    _mm256_storeu_ps(&best[c], better);
    worst = _mm256_max_ps(worst, better);
  }
  std::array<float, kLanes> lanes{};
  _mm256_storeu_ps(lanes.data(), worst);
  return *std::max_element(lanes.begin(), lanes.end());
}

// The angle d with 1 - cos d = h, from the sine of d / 2 or of its complement.
float angle_of(float h) {
  const float x = std::sqrt(0.5f * std::max(0.0f, std::min(h, 2 - h)));
  const float acute = 2 * shading::asin_acute(std::min(x, 0.70710678f));
  return h > 2.5f ? std::numbers::pi_v<float> : (h < 1 ? acute : std::numbers::pi_v<float> - acute);
}

}  // namespace

// With h = 1 - cos d, the pixels of rows theta and theta' have
// h = 2 sin^2(dtheta / 2) + sin theta sin theta' 2 sin^2(dphi / 2), free of cancellation. On one
// row h grows with |dphi|, so only the nearest opposite column of each row can win; rows further
// away than the worst of the row's distances cannot.
std::vector<float> signed_distance(std::span<const std::uint8_t> bits, std::uint32_t resolution) {
  const std::size_t n = resolution;
  CHECK_LE(n, kMaxResolution);
  CHECK_EQ(n % kLanes, 0U);
  CHECK_EQ(bits.size(), n * n / 8);
  const Chords chords(resolution);
  std::vector<std::uint32_t> value(n * n);
  for (std::size_t i = 0; i < n * n; ++i) {
    value[i] = (bits[i / 8] >> (i % 8) & 1U) != 0 ? kVisible : kBlocked;
  }
  std::vector<float> nearest_blocked(n * n);
  std::vector<float> nearest_visible(n * n);
  for (std::size_t r = 0; r < n; ++r) {
    const auto row = std::span<const std::uint32_t>(value).subspan(r * n, n);
    nearest_in_row(row, kBlocked, chords.columns_apart,
                   std::span(nearest_blocked).subspan(r * n, n));
    nearest_in_row(row, kVisible, chords.columns_apart,
                   std::span(nearest_visible).subspan(r * n, n));
  }

  std::vector<float> distances(n * n);
  for (std::size_t r = 0; r < n; ++r) {
    const auto own = std::span<const std::uint32_t>(value).subspan(r * n, n);
    const auto best = std::span(distances).subspan(r * n, n);
    std::fill(best.begin(), best.end(), kNone);
    const auto visit = [&](std::size_t other) {
      const std::size_t apart = other > r ? other - r : r - other;
      return improve(own, &nearest_blocked[other * n], &nearest_visible[other * n],
                     {chords.rows_apart[apart], chords.sine[r] * chords.sine[other]}, best);
    };
    float worst = visit(r);
    for (std::size_t k = 1; k < n && chords.rows_apart[k] < worst; ++k) {
      worst = k <= r ? visit(r - k) : worst;
      worst = r + k < n ? visit(r + k) : worst;
    }
    for (std::size_t c = 0; c < n; ++c) {
      const float angle = angle_of(best[c]);
      best[c] = own[c] == kVisible ? angle : -angle;
    }
  }
  return distances;
}

void correct_pixel_bias(std::span<float> distances, std::uint32_t resolution) {
  const float bias = 0.6f * std::numbers::pi_v<float> / static_cast<float>(resolution);
  for (float& d : distances) {
    const float size = std::abs(d);
    if (size < std::numbers::pi_v<float>) {
      d = std::copysign(size - std::min(bias, size / 2), d);
    }
  }
}

}  // namespace weft::transport
