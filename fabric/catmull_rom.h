#pragma once

namespace weft::fabric {

// The uniform Catmull-Rom spline through four values: p1 at f = 0, p2 at f = 1.
template <class T>
[[nodiscard]] T catmull_rom(const T& p0, const T& p1, const T& p2, const T& p3, double f) {
  return p1 + (p2 - p0) * (0.5 * f) + (p0 * 2.0 - p1 * 5.0 + p2 * 4.0 - p3) * (0.5 * f * f) +
         (p1 * 3.0 - p0 - p2 * 3.0 + p3) * (0.5 * f * f * f);
}

}  // namespace weft::fabric
