// Shared text (C++20 and GLSL): longitudinal angles about a fibre, accurate up to its axis.
#ifndef WEFT_SHADING_FIBRE_ANGLE_H
#define WEFT_SHADING_FIBRE_ANGLE_H

#include "shading/dialect.h"

SHARED_BEGIN

// A direction relative to a fibre along x: omega = (sin theta, cos theta cos phi, cos theta sin
// phi).
struct FibreAngle {
  float sin_theta;
  float cos_theta;  // from y and z, hence exact at grazing too
  float theta;      // -pi/2 ... pi/2
  float pole;       // pi/2 - |theta|, exact at grazing too
};

// asin(x) for 0 <= x <= sqrt(1/2), relative error 1.5e-7 (least squares in x^2 at Chebyshev
// nodes). The built-in asin of graphics devices is off by 1e-4.
SHARED float asin_acute(float x) {
  float z = x * x;
  float p = -0.0940462798f + z * 0.111960903f;
  p = 0.0782289207f + z * p;
  p = 0.0158279035f + z * p;
  p = 0.0466362163f + z * p;
  p = 0.0748684704f + z * p;
  p = 0.166669935f + z * p;
  return x + x * z * p;
}

// Angle of the point (x, y) from the x axis, -pi ... pi, relative error 3e-7, for numbers up to
// 1e18; 0 at the origin. The built-in atan of graphics devices is off by 2e-5 and undefined there.
SHARED float angle_of(float y, float x) {
  float length2 = x * x + y * y;
  if (length2 < 1e-37f) {
    return 0.0f;
  }
  float acute = asin_acute(min(min(abs(x), abs(y)) / sqrt(length2), 0.70710678f));
  float angle = abs(y) > abs(x) ? kHalfPi - acute : acute;
  angle = x < 0.0f ? kPi - angle : angle;
  return y < 0.0f ? -angle : angle;
}

SHARED FibreAngle fibre_angle(vec3 omega) {
  FibreAngle a;
  a.sin_theta = omega.x;
  a.cos_theta = sqrt(omega.y * omega.y + omega.z * omega.z);
  float s = abs(omega.x);
  bool steep = s < a.cos_theta;
  float acute = asin_acute(min(min(s, a.cos_theta), 0.70710678f));
  float magnitude = steep ? acute : kHalfPi - acute;
  a.pole = steep ? kHalfPi - acute : acute;
  a.theta = omega.x < 0.0f ? -magnitude : magnitude;
  return a;
}

// cos(phi_i - phi_o), and 1 for directions along the fibre's axis, which have no phi.
SHARED float cos_phi_between(vec3 omega_i, FibreAngle i, vec3 omega_o, FibreAngle o) {
  if (i.cos_theta < 1e-7f) {
    return 1.0f;
  }
  if (o.cos_theta < 1e-7f) {
    return clamp(omega_i.y / i.cos_theta, -1.0f, 1.0f);
  }
  float d = omega_i.y * omega_o.y + omega_i.z * omega_o.z;
  return clamp(d / (i.cos_theta * o.cos_theta), -1.0f, 1.0f);
}

// sin(x) for |x| <= pi/2, relative error 1.4e-7 (fitted like asin_acute).
SHARED float sin_quarter(float x) {
  float z = x * x;
  float p = -0.000198227572f + z * 2.63480274e-6f;
  p = 0.0083332425f + z * p;
  p = -0.166666657f + z * p;
  return x + x * z * p;
}

// (cos x, sin x) for |x| <= pi.
SHARED vec2 cos_sin_half(float x) {
  float magnitude = abs(x);
  float to_axis = kHalfPi - magnitude;
  // sin |x| = sin(pi - |x|), taken on the side where it does not lose the angle's last bits.
  float s = sin_quarter(to_axis < 0.0f ? kPi - magnitude : magnitude);
  return vec2(sin_quarter(to_axis), x < 0.0f ? -s : s);
}

// Rows x = tangent, y = omega_o orthogonal to it, z = x cross y, so that omega_local = frame *
// omega and phi_o = 0 (omega_o-space, Khungurn et al. 2017, section 4.3). Any y orthogonal to x
// where omega_o lies along the fibre. Both are unit vectors.
SHARED mat3 fibre_frame(vec3 tangent, vec3 omega_o) {
  vec3 x = tangent;
  vec3 y = omega_o - x * dot(omega_o, x);
  if (dot(y, y) < 1e-12f) {
    vec3 e = abs(x.x) < 0.7f ? vec3(1.0f, 0.0f, 0.0f) : vec3(0.0f, 1.0f, 0.0f);
    y = e - x * dot(e, x);
  }
  y = normalize(y);
  vec3 z = cross(x, y);
  // Columns of the matrix are what the unit vectors of the outer space become.
  return mat3(vec3(x.x, y.x, z.x), vec3(x.y, y.y, z.y), vec3(x.z, y.z, z.z));
}

SHARED_END

#endif
