// Shared text (C++20 and GLSL): modified Bessel functions.
#ifndef WEFT_SHADING_BESSEL_H
#define WEFT_SHADING_BESSEL_H

#include "shading/dialect.h"

SHARED_BEGIN

// e^-x I0(x) for x >= 0: Abramowitz and Stegun 9.8.1 and 9.8.2, relative error below 5e-7. Never
// through log I0, whose value in float is coarser than what is left of it.
SHARED float bessel_i0e(float x) {
  if (x < 3.75f) {
    float t = x / 3.75f;
    float t2 = t * t;
    float p = 0.0360768f + t2 * 0.0045813f;
    p = 0.2659732f + t2 * p;
    p = 1.2067492f + t2 * p;
    p = 3.0899424f + t2 * p;
    p = 3.5156229f + t2 * p;
    return exp(-x) * (1.0f + t2 * p);
  }
  float t = 3.75f / x;
  float p = -0.01647633f + t * 0.00392377f;
  p = 0.02635537f + t * p;
  p = -0.02057706f + t * p;
  p = 0.00916281f + t * p;
  p = -0.00157565f + t * p;
  p = 0.00225319f + t * p;
  p = 0.01328592f + t * p;
  return (0.39894228f + t * p) * inversesqrt(x);
}

SHARED_END

#endif
