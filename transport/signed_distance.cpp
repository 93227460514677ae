#include "transport/signed_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/check.h"
#include "transport/sphere.h"
#include "transport/visibility.h"

namespace weft::transport {

namespace {

constexpr float kNone = 1e9f;  // larger than any 2 sin^2

// For every pixel of one row, 2 sin^2(dphi / 2) to the nearest pixel of the row whose value is
// `wanted`, round the circle; kNone where there is none.
void nearest_in_row(std::span<const std::uint8_t> row, std::uint8_t wanted,
                    std::span<const float> chord_of_steps, std::span<float> nearest) {
  const auto n = static_cast<std::int32_t>(row.size());
  const std::int32_t far = 2 * n;
  std::vector<std::int32_t> steps(row.size(), far);
  std::int32_t since = far;
  for (std::int32_t i = -n; i < n; ++i) {  // twice round: the first time only to wrap
    const auto c = static_cast<std::size_t>((i + n) % n);
    since = row[c] == wanted ? 0 : std::min(since + 1, far);
    steps[c] = std::min(steps[c], since);
  }
  since = far;
  for (std::int32_t i = 2 * n - 1; i >= 0; --i) {
    const auto c = static_cast<std::size_t>(i % n);
    since = row[c] == wanted ? 0 : std::min(since + 1, far);
    steps[c] = std::min(steps[c], since);
  }
  for (std::size_t c = 0; c < row.size(); ++c) {
    nearest[c] = steps[c] >= n ? kNone : chord_of_steps[static_cast<std::size_t>(steps[c])];
  }
}

}  // namespace

// With h = 1 - cos d, the pixels of rows theta and theta' have
// h = 2 sin^2(dtheta / 2) + sin theta sin theta' 2 sin^2(dphi / 2), free of cancellation. On one
// row h grows with |dphi|, so only the nearest opposite column of each row can win.
std::vector<float> signed_distance(std::span<const std::uint8_t> bits, std::uint32_t resolution) {
  const std::size_t n = resolution;
  CHECK_EQ(bits.size(), n * n / 8);
  std::vector<std::uint8_t> value(n * n);
  for (std::size_t i = 0; i < n * n; ++i) {
    value[i] = is_visible(bits, i) ? 1 : 0;
  }
  std::vector<float> row_gap(n);  // 2 sin^2 of half the angle between rows i apart
  std::vector<float> chord(n);    // the same between columns i apart
  std::vector<float> sine(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double step = std::numbers::pi / static_cast<double>(n) * static_cast<double>(i);
    row_gap[i] = static_cast<float>(2 * std::pow(std::sin(step / 2), 2));
    chord[i] = static_cast<float>(2 * std::pow(std::sin(step), 2));
    sine[i] = static_cast<float>(std::sin(row_theta(static_cast<std::uint32_t>(i), resolution)));
  }
  // nearest[v]: from a pixel of value v to one of the other value.
  std::vector<float> nearest_blocked(n * n);
  std::vector<float> nearest_visible(n * n);
  for (std::size_t r = 0; r < n; ++r) {
    const std::span<const std::uint8_t> row(&value[r * n], n);
    nearest_in_row(row, 0, chord, std::span(&nearest_blocked[r * n], n));
    nearest_in_row(row, 1, chord, std::span(&nearest_visible[r * n], n));
  }

  std::vector<float> distances(n * n);
  std::vector<float> best(n);
  for (std::size_t r = 0; r < n; ++r) {
    std::fill(best.begin(), best.end(), kNone);
    const std::uint8_t* own = &value[r * n];
    const auto visit = [&](std::size_t other) {
      const float gap = row_gap[other > r ? other - r : r - other];
      const float scale = sine[r] * sine[other];
      const float* blocked = &nearest_blocked[other * n];
      const float* visible = &nearest_visible[other * n];
      float worst = 0;
      for (std::size_t c = 0; c < n; ++c) {
        const float around = own[c] != 0 ? blocked[c] : visible[c];
        best[c] = std::min(best[c], gap + scale * around);
        worst = std::max(worst, best[c]);
      }
      return worst;
    };
    float worst = visit(r);
    for (std::size_t k = 1; k < n && row_gap[k] < worst; ++k) {
      if (k <= r) {
        worst = visit(r - k);
      }
      if (r + k < n) {
        worst = visit(r + k);
      }
    }
    for (std::size_t c = 0; c < n; ++c) {
      const float angle =
          best[c] > 2.5f ? std::numbers::pi_v<float> : 2 * std::asin(std::sqrt(best[c] / 2));
      distances[r * n + c] = own[c] != 0 ? angle : -angle;
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
