// Shared text (C++20 and GLSL): real spherical harmonics up to order 5.
#ifndef WEFT_SHADING_SPHERICAL_HARMONICS_H
#define WEFT_SHADING_SPHERICAL_HARMONICS_H

#include "shading/dialect.h"

SHARED_BEGIN

const int kShMaxOrder = 5;
const int kShMaxCount = 36;

// Coefficients j = l (l + 1) + m of the orthonormal real harmonics without the Condon-Shortley
// phase: Y_1 = 0.4886 y, Y_2 = 0.4886 z, Y_3 = 0.4886 x. Entries above the order in use are zero.
// Loops over them go in six times six: Mesa unrolls no loop of more than 32 rounds, and an array
// whose indices are not known lies in memory.
struct ShVector {
  float c[36];
};

SHARED ShVector sh_zero() {
  ShVector v;
  for (int row = 0; row < 6; ++row) {
    for (int k = 0; k < 6; ++k) {
      v.c[6 * row + k] = 0.0f;
    }
  }
  return v;
}

SHARED float sh_dot(ShVector a, ShVector b) {
  float sum = 0.0f;
  for (int row = 0; row < 6; ++row) {
    for (int k = 0; k < 6; ++k) {
      sum += a.c[6 * row + k] * b.c[6 * row + k];
    }
  }
  return sum;
}

// Recurrences of the associated Legendre functions over z^2 = 1 - x^2 - y^2 with the
// normalisation folded in: pLM = a z p(L-1)M - b p(L-2)M, and cM + i sM = (x + i y)^M. No
// trigonometry and nothing singular at the poles.
SHARED ShVector sh_evaluate_upper(vec3 w, ShVector y) {
  // m = 2
  float c2 = w.x * w.x - w.y * w.y;
  float s2 = 2.0f * w.x * w.y;
  float p22 = 0.546274215f;
  float p32 = 1.44530572f * w.z;
  float p42 = 2.29128785f * w.z * p32 - 0.866025404f * p22;
  float p52 = 2.17124059f * w.z * p42 - 0.947607083f * p32;
  y.c[8] = p22 * c2;
  y.c[4] = p22 * s2;
  y.c[14] = p32 * c2;
  y.c[10] = p32 * s2;
  y.c[22] = p42 * c2;
  y.c[18] = p42 * s2;
  y.c[32] = p52 * c2;
  y.c[28] = p52 * s2;
  // m = 3
  float c3 = w.x * c2 - w.y * s2;
  float s3 = w.x * s2 + w.y * c2;
  float p33 = 0.59004359f;
  float p43 = 1.77013077f * w.z;
  float p53 = 2.48746859f * w.z * p43 - 0.829156198f * p33;
  y.c[15] = p33 * c3;
  y.c[9] = p33 * s3;
  y.c[23] = p43 * c3;
  y.c[17] = p43 * s3;
  y.c[33] = p53 * c3;
  y.c[27] = p53 * s3;
  // m = 4
  float c4 = w.x * c3 - w.y * s3;
  float s4 = w.x * s3 + w.y * c3;
  float p44 = 0.625835735f;
  float p54 = 2.07566231f * w.z;
  y.c[24] = p44 * c4;
  y.c[16] = p44 * s4;
  y.c[34] = p54 * c4;
  y.c[26] = p54 * s4;
  // m = 5
  float c5 = w.x * c4 - w.y * s4;
  float s5 = w.x * s4 + w.y * c4;
  float p55 = 0.656382057f;
  y.c[35] = p55 * c5;
  y.c[25] = p55 * s5;
  return y;
}

// Y_0 ... Y_35 in the unit direction w.
SHARED ShVector sh_evaluate(vec3 w) {
  ShVector y;
  // m = 0
  float p00 = 0.282094792f;
  float p10 = 0.488602512f * w.z;
  float p20 = 1.93649167f * w.z * p10 - 1.11803399f * p00;
  float p30 = 1.97202659f * w.z * p20 - 1.01835015f * p10;
  float p40 = 1.98431348f * w.z * p30 - 1.00623059f * p20;
  float p50 = 1.98997487f * w.z * p40 - 1.00285307f * p30;
  y.c[0] = p00;
  y.c[2] = p10;
  y.c[6] = p20;
  y.c[12] = p30;
  y.c[20] = p40;
  y.c[30] = p50;
  // m = 1
  float p11 = 0.488602512f;
  float p21 = 1.09254843f * w.z;
  float p31 = 2.09165007f * w.z * p21 - 0.935414347f * p11;
  float p41 = 2.04939015f * w.z * p31 - 0.979795897f * p21;
  float p51 = 2.0310096f * w.z * p41 - 0.991031209f * p31;
  y.c[3] = p11 * w.x;
  y.c[1] = p11 * w.y;
  y.c[7] = p21 * w.x;
  y.c[5] = p21 * w.y;
  y.c[13] = p31 * w.x;
  y.c[11] = p31 * w.y;
  y.c[21] = p41 * w.x;
  y.c[19] = p41 * w.y;
  y.c[31] = p51 * w.x;
  y.c[29] = p51 * w.y;
  return sh_evaluate_upper(w, y);
}

// A_l, l = 0 ... 5: the zonal coefficients of a rotationally symmetric function f about an axis xi,
// c[l, m] = A_l Y_lm(xi), A_l = integral of f P_l.
struct ShZonal {
  float a[6];
};

// A_l(lambda) = I_{l+1/2}(lambda) / I_{1/2}(lambda) of the normalised spherical Gaussian of
// sharpness lambda >= 0. The upward recurrence A_{l+1} = A_{l-1} - (2l + 1) A_l / lambda is stable
// for lambda >= 10 only; below, ratios r_l = A_l / A_{l-1} go down from far above the order.
SHARED ShZonal sg_zonal(float lambda) {
  ShZonal z;
  z.a[0] = 1.0f;
  if (lambda >= 10.0f) {
    z.a[1] = 1.0f - 1.0f / lambda;
    for (int l = 1; l < kShMaxOrder; ++l) {
      z.a[l + 1] = z.a[l - 1] - float(2 * l + 1) * z.a[l] / lambda;
    }
    return z;
  }
  float top = float(kShMaxOrder) + 25.5f;
  float r = lambda / (top + sqrt(top * top + lambda * lambda));
  for (int l = kShMaxOrder + 24; l > kShMaxOrder; --l) {
    r = lambda / (float(2 * l + 1) + lambda * r);
  }
  float ratio[6];
  for (int l = kShMaxOrder; l > 0; --l) {
    r = lambda / (float(2 * l + 1) + lambda * r);
    ratio[l] = r;
  }
  for (int l = 1; l <= kShMaxOrder; ++l) {
    z.a[l] = z.a[l - 1] * ratio[l];
  }
  return z;
}

// The zonal function about the unit axis xi: no rotation matrix is needed.
SHARED ShVector sh_zonal_about(ShZonal z, vec3 xi) {
  ShVector y = sh_evaluate(xi);
  for (int l = 0; l <= kShMaxOrder; ++l) {
    for (int j = l * l; j < (l + 1) * (l + 1); ++j) {
      y.c[j] *= z.a[l];
    }
  }
  return y;
}

SHARED_END

#endif
