// Shared text (C++20 and GLSL): the error function.
#ifndef WEFT_SHADING_ERROR_FUNCTION_H
#define WEFT_SHADING_ERROR_FUNCTION_H

#include "shading/dialect.h"

SHARED_BEGIN

// erf(x), absolute error below 2e-7 (minimax polynomials after N. Juffa; GLSL has no erf).
SHARED float error_function(float x) {
  float t = min(abs(x), 4.0f);
  float s = t * t;
  if (t > 0.927734375f) {
    float r = -1.72853470e-5f * t + 3.83197126e-4f;
    float u = -3.88396438e-3f * t + 2.42546219e-2f;
    r = r * s + u;
    r = r * t - 1.06777877e-1f;
    r = r * t - 6.34846687e-1f;
    r = r * t - 1.28717512e-1f;
    r = 1.0f - exp(r * t - t);
    return x < 0.0f ? -r : r;
  }
  float p = -5.96761703e-4f * s + 4.99119423e-3f;
  p = p * s - 2.67681349e-2f;
  p = p * s + 1.12819925e-1f;
  p = p * s - 3.76125336e-1f;
  p = p * s + 1.28379166e-1f;
  return p * x + x;
}

SHARED_END

#endif
