// Shared text (C++20 and GLSL): spherical Gaussians G(omega; xi, lambda) = exp(lambda (omega . xi -
// 1)).
#ifndef WEFT_SHADING_SPHERICAL_GAUSSIAN_H
#define WEFT_SHADING_SPHERICAL_GAUSSIAN_H

#include "shading/dialect.h"

SHARED_BEGIN

struct SphericalGaussian {
  vec3 axis;  // unit
  float sharpness;
};

// For unit vectors a and b, 1 - a . b without the cancellation about a = b.
SHARED float one_minus_dot(vec3 a, vec3 b) {
  vec3 d = a - b;
  return 0.5f * dot(d, d);
}

SHARED float sg_evaluate(SphericalGaussian g, vec3 omega) {
  return exp(-g.sharpness * one_minus_dot(omega, g.axis));
}

// M(lambda), the integral of G over the sphere: 2 pi (1 - exp(-2 lambda)) / lambda.
SHARED float sg_mass(float lambda) {
  float x = 2.0f * lambda;
  if (x < 0.5f) {
    // (1 - e^-x) / x by its series: subtraction would cancel.
    float s = 1.0f - x * (1.0f / 8.0f);
    s = 1.0f - x * (1.0f / 7.0f) * s;
    s = 1.0f - x * (1.0f / 6.0f) * s;
    s = 1.0f - x * (1.0f / 5.0f) * s;
    s = 1.0f - x * (1.0f / 4.0f) * s;
    s = 1.0f - x * (1.0f / 3.0f) * s;
    s = 1.0f - x * (1.0f / 2.0f) * s;
    return kFourPi * s;
  }
  return kTwoPi * (1.0f - exp(-x)) / lambda;
}

// G(a) G(b) = exp(log_scale) G(sg).
struct SgProduct {
  SphericalGaussian sg;
  float log_scale;  // <= 0
};

// With s = lambda_a xi_a + lambda_b xi_b: sharpness |s|, axis s / |s|, and log_scale = |s| -
// lambda_a - lambda_b in a form that does not cancel. Opposite Gaussians of equal sharpness give a
// constant, whose axis is arbitrary.
SHARED SgProduct sg_product(SphericalGaussian a, SphericalGaussian b) {
  vec3 s = a.axis * a.sharpness + b.axis * b.sharpness;
  SgProduct p;
  p.sg.sharpness = length(s);
  p.sg.axis = p.sg.sharpness > 1e-12f ? s / p.sg.sharpness : a.axis;
  p.log_scale = -2.0f * a.sharpness * b.sharpness * one_minus_dot(a.axis, b.axis) /
                max(a.sharpness + b.sharpness + p.sg.sharpness, 1e-30f);
  return p;
}

SHARED_END

#endif
