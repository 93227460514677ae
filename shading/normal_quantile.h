// Shared text (C++20 and GLSL): quantiles of the normal distribution.
#ifndef WEFT_SHADING_NORMAL_QUANTILE_H
#define WEFT_SHADING_NORMAL_QUANTILE_H

#include "shading/dialect.h"

SHARED_BEGIN

// x with P(standard normal > x) = q for 0 < q <= 1/2: Wichura 1988, algorithm AS 241 (PPND7),
// relative error about 1e-7. q is the upper tail itself, so that nothing cancels there.
SHARED float normal_upper_quantile(float q) {
  if (q > 0.075f) {
    float d = 0.5f - q;
    float r = 0.180625f - d * d;
    float a = ((59.10937472f * r + 159.29113202f) * r + 50.434271938f) * r + 3.3871327179f;
    float b = ((67.18756360f * r + 78.757757664f) * r + 17.895169469f) * r + 1.0f;
    return d * a / b;
  }
  float r = sqrt(-log(q));
  if (r <= 5.0f) {
    float s = r - 1.6f;
    float a = ((0.17023821103f * s + 1.3067284816f) * s + 2.7568153900f) * s + 1.4234372777f;
    float b = (0.12021132975f * s + 0.73700164250f) * s + 1.0f;
    return a / b;
  }
  float s = r - 5.0f;
  float a = ((0.017337203997f * s + 0.42868294337f) * s + 3.0812263860f) * s + 6.6579051150f;
  float b = (0.012258202635f * s + 0.24197894225f) * s + 1.0f;
  return a / b;
}

SHARED_END

#endif
