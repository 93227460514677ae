#pragma once

#include <cmath>

namespace weft::shading {

// x with P(standard normal > x) = q for 0 < q <= 1/2: Wichura 1988, algorithm AS 241 (PPND7),
// relative error about 1e-7. q is the upper tail itself, so that nothing cancels there.
[[nodiscard]] inline float normal_upper_quantile(float q) {
  if (q > 0.075f) {
    const float d = 0.5f - q;
    const float r = 0.180625f - d * d;
    const float a = ((59.10937472f * r + 159.29113202f) * r + 50.434271938f) * r + 3.3871327179f;
    const float b = ((67.18756360f * r + 78.757757664f) * r + 17.895169469f) * r + 1.0f;
    return d * a / b;
  }
  const float r = std::sqrt(-std::log(q));
  if (r <= 5.0f) {
    const float s = r - 1.6f;
    const float a = ((0.17023821103f * s + 1.3067284816f) * s + 2.7568153900f) * s + 1.4234372777f;
    const float b = (0.12021132975f * s + 0.73700164250f) * s + 1.0f;
    return a / b;
  }
  const float s = r - 5.0f;
  const float a = ((0.017337203997f * s + 0.42868294337f) * s + 3.0812263860f) * s + 6.6579051150f;
  const float b = (0.012258202635f * s + 0.24197894225f) * s + 1.0f;
  return a / b;
}

}  // namespace weft::shading
