// Shared text (C++20 and GLSL): calls every function of shading/ with numbers from an array and
// lays its results into another, so that one text runs on the device and on the host. The including
// program defines `FibreLobes parity_lobes(int material)`.
#ifndef WEFT_TESTS_KERNELS_PARITY_CASES_H
#define WEFT_TESTS_KERNELS_PARITY_CASES_H

#include "render/kernels/random.h"
#include "shading/bcsdf.h"
#include "shading/bessel.h"
#include "shading/error_function.h"
#include "shading/fibre_angle.h"
#include "shading/gamma.h"
#include "shading/normal_quantile.h"
#include "shading/sh_rotation.h"
#include "shading/spherical_gaussian.h"
#include "shading/spherical_harmonics.h"
#include "shading/visibility.h"

SHARED_BEGIN

const int kParityNumbers = 40;

// Directions are unit, three numbers each.
struct ParityInput {
  vec3 a;
  vec3 b;
  vec3 c;
  float sharpness_a;
  float sharpness_b;
  float unit[6];  // in [0, 1)
  int material;
  int count;
};

struct ParityOutput {
  float v[40];
  int n[8];
};

SHARED ParityOutput parity_nothing() {
  ParityOutput r;
  for (int k = 0; k < kParityNumbers; ++k) {
    r.v[k] = 0.0f;
  }
  for (int k = 0; k < 8; ++k) {
    r.n[k] = 0;
  }
  return r;
}

SHARED ParityOutput put_vec2(ParityOutput r, int at, vec2 x) {
  r.v[at] = x.x;
  r.v[at + 1] = x.y;
  return r;
}
SHARED ParityOutput put_vec3(ParityOutput r, int at, vec3 x) {
  r.v[at] = x.x;
  r.v[at + 1] = x.y;
  r.v[at + 2] = x.z;
  return r;
}
SHARED ParityOutput put_angle(ParityOutput r, int at, FibreAngle x) {
  r.v[at] = x.sin_theta;
  r.v[at + 1] = x.cos_theta;
  r.v[at + 2] = x.theta;
  r.v[at + 3] = x.pole;
  return r;
}

SHARED ParityOutput parity_functions_of_one(ParityInput x) {
  ParityOutput r = parity_nothing();
  r.v[0] = bessel_i0e(x.sharpness_a);
  r.v[1] = error_function(8.0f * x.unit[0] - 4.0f);
  r.v[2] = error_function(x.sharpness_a);
  r.v[3] = normal_upper_quantile(0.5f * (1.0f - x.unit[1]));
  r.v[4] = normal_upper_quantile(exp(-80.0f * x.unit[2]) * 0.5f);
  r.v[5] = asin_acute(0.70710678f * x.unit[3]);
  r.v[6] = sin_quarter(kHalfPi * (2.0f * x.unit[4] - 1.0f));
  r = put_vec2(r, 7, cos_sin_half(kPi * (2.0f * x.unit[5] - 1.0f)));
  r.v[9] = sg_mass(x.sharpness_b);
  r.v[10] = ssdf_visibility(kPi * (x.unit[0] - 0.5f), x.sharpness_a);
  r.v[11] = ssdf_share(x.sharpness_b, 100.0f, 200.0f);
  r.v[12] = schlick_weight(x.unit[0]);
  return r;
}

SHARED ParityOutput parity_fibre_angles(ParityInput x) {
  ParityOutput r = parity_nothing();
  FibreAngle a = fibre_angle(x.a);
  FibreAngle b = fibre_angle(x.b);
  r = put_angle(r, 0, a);
  r.v[4] = cos_phi_between(x.a, a, x.b, b);
  mat3 frame = fibre_frame(x.c, x.b);
  r = put_vec3(r, 5, frame * x.a);
  r = put_vec3(r, 8, frame[1]);
  return r;
}

SHARED ParityOutput parity_bcsdf(ParityInput x) {
  ParityOutput r = parity_nothing();
  FibreLobes lobes = parity_lobes(x.material);
  FibreAngle i = fibre_angle(x.a);
  FibreAngle o = fibre_angle(x.b);
  r = put_vec3(r, 0, fresnel(lobes.c_r, i.cos_theta));
  r = put_vec2(r, 3, lobe_norm(lobes, i.pole));
  vec2 gaussians = lobe_gaussians(lobes, i.theta, o.theta);
  r = put_vec2(r, 5, gaussians);
  LobePair s = bcsdf_lobes(lobes, i, gaussians, cos_phi_between(x.a, i, x.b, o));
  r = put_vec3(r, 7, s.r);
  r = put_vec3(r, 10, s.tt);
  r = put_vec3(r, 13, bcsdf(lobes, x.a, x.b));
  return r;
}

SHARED SphericalGaussian parity_gaussian(ParityInput x) {
  SphericalGaussian g;
  g.axis = x.a;
  g.sharpness = x.sharpness_a;
  return g;
}

SHARED ParityOutput parity_gamma_parts(ParityInput x) {
  ParityOutput r = parity_nothing();
  FibreLobes lobes = parity_lobes(x.material);
  FibreAngle o = fibre_angle(x.b);
  GammaLight light = gamma_light(parity_gaussian(x), x.b, o);
  r.v[0] = light.lambda;
  r.v[1] = light.theta;
  r.v[2] = light.cos_theta;
  r.v[3] = light.cos_phi;
  GammaPeak peak = gamma_peak(lobes.precision_r, o.theta, light);
  r.v[4] = peak.theta;
  r.v[5] = peak.sharpness;
  r.v[6] = peak.height;
  float theta = kHalfPi * (2.0f * x.unit[0] - 1.0f);
  r = put_vec3(r, 7, gamma_factor(lobes, light, theta, false));
  r = put_vec3(r, 10, gamma_factor(lobes, light, theta, true));
  Gl12Node node = gl12_node(x.count % 12);
  r.v[13] = node.x;
  r.v[14] = node.weight;
  return r;
}

SHARED ParityOutput parity_gamma(ParityInput x) {
  ParityOutput r = parity_nothing();
  FibreLobes lobes = parity_lobes(x.material);
  for (int method = 0; method < 3; ++method) {
    r = put_vec3(r, 3 * method, gamma_integral(lobes, parity_gaussian(x), x.b, method));
  }
  return r;
}

SHARED ParityOutput parity_spherical_gaussians(ParityInput x) {
  ParityOutput r = parity_nothing();
  SphericalGaussian a = parity_gaussian(x);
  SphericalGaussian b;
  b.axis = x.b;
  b.sharpness = x.sharpness_b;
  r.v[0] = one_minus_dot(x.a, x.b);
  r.v[1] = sg_evaluate(a, x.c);
  SgProduct p = sg_product(a, b);
  r.v[2] = p.sg.sharpness;
  r = put_vec3(r, 3, p.sg.axis);
  r.v[6] = p.log_scale;
  return r;
}

SHARED ParityOutput parity_visibility_maps(ParityInput x) {
  ParityOutput r = parity_nothing();
  int resolution = 2 * (1 + x.count % 64);
  int row = x.count % resolution;
  int column = (x.count / 7) % resolution;
  r = put_vec2(r, 0, map_coordinates(x.a, resolution));
  r = put_vec3(r, 2, map_direction(row, column, resolution));
  r.v[5] = map_solid_angle(row, resolution);
  r = put_vec3(r, 6, fibonacci_axis(x.count % 48, 48, x.unit[0]));
  r = put_vec3(r, 9, fibonacci_axis_sphere(x.count % 48, 48, x.unit[0]));
  MapFootprint f = map_footprint(x.a, resolution);
  // What interpolates is continuous, the four pixels and their weights are not.
  for (int k = 0; k < 4; ++k) {
    r.v[12] += f.weight[k] * fract(float(f.index[k]) * 0.618033989f);
    r.v[13] += f.weight[k];
  }
  r.v[14] = angle_of(x.a.y, x.a.x);
  r.v[15] = angle_of(x.b.z, x.b.y);
  r.n[0] = map_pixel(x.a, resolution);
  r.n[1] = map_wrapped_index(row - resolution / 2, 3 * column - resolution, resolution);
  return r;
}

SHARED ShVector parity_vector(ParityInput x) {
  ShVector v = sh_evaluate(x.c);
  for (int j = 0; j < kShMaxCount; ++j) {
    v.c[j] = v.c[j] + x.unit[j % 6] - 0.5f;
  }
  return v;
}

SHARED ParityOutput put_sh(ShVector v) {
  ParityOutput r = parity_nothing();
  for (int j = 0; j < kShMaxCount; ++j) {
    r.v[j] = v.c[j];
  }
  return r;
}

SHARED ParityOutput parity_harmonics(ParityInput x) {
  ParityOutput r = put_sh(sh_evaluate(x.a));
  r.v[36] = sh_dot(sh_evaluate(x.a), sh_evaluate(x.b));
  return r;
}

SHARED ParityOutput parity_zonal(ParityInput x) {
  ShZonal z = sg_zonal(x.sharpness_a);
  ParityOutput r = put_sh(sh_zonal_about(z, x.a));
  r.v[36] = z.a[1];
  r.v[37] = z.a[3];
  r.v[38] = z.a[5];
  return r;
}

SHARED ParityOutput parity_turns(ParityInput x) {
  ShVector v = parity_vector(x);
  ShVector turned = sh_turn_about_z(v, x.a.x, sqrt(max(0.0f, 1.0f - x.a.x * x.a.x)));
  ShVector there = sh_turn_z_to_y(turned);
  ShVector back = sh_turn_y_to_z(v);
  for (int j = 0; j < kShMaxCount; ++j) {
    there.c[j] += 2.0f * back.c[j];
  }
  return put_sh(there);
}

SHARED ParityOutput parity_rotation(ParityInput x) {
  ShRotation turn = sh_rotation(fibre_frame(x.a, x.b));
  ParityOutput r = put_sh(sh_rotate(turn, parity_vector(x)));
  r = put_vec2(r, 36, turn.beta);
  return r;
}

// Words of a random stream, as integers.
SHARED ParityOutput parity_random(ParityInput x) {
  ParityOutput r = parity_nothing();
  RandomStream stream;
  stream.key = uvec2(floatBitsToUint(x.unit[0]), floatBitsToUint(x.a.x));
  stream.pixel = floatBitsToUint(x.sharpness_a);
  stream.sample_index = uint(x.count);
  uvec4 words = random_words(stream, light_block(x.material, x.count));
  r.n[0] = int(words.x);
  r.n[1] = int(words.y);
  r.n[2] = int(words.z);
  r.n[3] = int(words.w);
  vec4 u = random_uniforms(stream, kEyeBlock);
  r.v[0] = u.x;
  r.v[1] = u.y;
  r.v[2] = u.z;
  r.v[3] = u.w;
  return r;
}

const int kParityCases = 12;

SHARED ParityOutput parity_case(int which, ParityInput x) {
  switch (which) {
    case 0:
      return parity_functions_of_one(x);
    case 1:
      return parity_fibre_angles(x);
    case 2:
      return parity_bcsdf(x);
    case 3:
      return parity_gamma_parts(x);
    case 4:
      return parity_gamma(x);
    case 5:
      return parity_spherical_gaussians(x);
    case 6:
      return parity_visibility_maps(x);
    case 7:
      return parity_harmonics(x);
    case 8:
      return parity_zonal(x);
    case 9:
      return parity_turns(x);
    case 10:
      return parity_rotation(x);
    default:
      return parity_random(x);
  }
}

SHARED_END

#endif
