// Shared text (C++20 and GLSL): Gamma, the integral of a spherical Gaussian times S cos(theta_i)
// over the sphere (Khungurn et al. 2017, eq. 2, corrected: lambda_R = (beta^-2 + lambda) / 2 and
// theta_R with beta^-2 in its numerator).
#ifndef WEFT_SHADING_GAMMA_H
#define WEFT_SHADING_GAMMA_H

#include "shading/bcsdf.h"
#include "shading/bessel.h"
#include "shading/dialect.h"
#include "shading/error_function.h"
#include "shading/spherical_gaussian.h"

SHARED_BEGIN

// How the integral over theta is taken.
const int kGammaClosed = 0;  // slowly varying factors frozen at the product's peak
const int kGammaGl12 = 1;    // 12-node Gauss-Legendre: within 3e-5 of the peak
const int kGammaHybrid = 2;  // closed where the product stays within 60 degrees, else GL12

// The azimuth integrates exactly to I0, which leaves, for m = R, TT and b = 1 / beta_m^2,
//   E_m = int exp(lambda (cos(theta - theta') - 1) - b (theta + theta_o)^2 / 2) B_m(theta) dtheta,
//   B_R = F cos^2 / (sqrt(2 pi) beta G) I0e(k), k = lambda cos theta' cos theta
//   B_TT = (1 - F) C_TT cos^2 / (sqrt(2 pi) beta G) I0e(m) / I0e(kappa) exp(m - k - kappa),
//   m = sqrt(kappa^2 + k^2 - 2 kappa k cos phi').
// The spherical Gaussian in fibre coordinates:
struct GammaLight {
  float lambda;
  float theta;      // theta'
  float cos_theta;  // cos theta'
  float cos_phi;    // cos(phi' - phi_o)
};

SHARED vec3 gamma_factor_r(FibreLobes lobes, GammaLight light, float theta) {
  float c = max(0.0f, sin_quarter(kHalfPi - abs(theta)));
  float rho = c * c / lobe_norm(lobes, kHalfPi - abs(theta)).x;
  return fresnel(lobes.c_r, c) * (rho * bessel_i0e(light.lambda * light.cos_theta * c));
}

SHARED vec3 gamma_factor_tt(FibreLobes lobes, GammaLight light, float theta) {
  float c = max(0.0f, sin_quarter(kHalfPi - abs(theta)));
  float rho = c * c / lobe_norm(lobes, kHalfPi - abs(theta)).y;
  float k = light.lambda * light.cos_theta * c;
  float kappa = lobes.kappa_tt;
  float d = kappa - k;
  // (kappa - k)^2 + 2 kappa k (1 - cos phi') does not cancel about phi' = 0.
  float m = sqrt(max(0.0f, d * d + 2.0f * kappa * k * (1.0f - light.cos_phi)));
  // m - k - kappa without its cancellation about phi' = pi.
  float exponent = -2.0f * kappa * k * (1.0f + light.cos_phi) / max(m + k + kappa, 1e-30f);
  float azimuth = bessel_i0e(m) * exp(exponent) * kTwoPi * lobes.azimuth_norm;
  vec3 f = fresnel(lobes.c_r, c);
  return (vec3(1.0f, 1.0f, 1.0f) - f) * lobes.c_tt * (rho * azimuth);
}

// The product of the two Gaussians in theta.
struct GammaPeak {
  float theta;      // theta_m = (-b theta_o + lambda theta') / (b + lambda)
  float sharpness;  // b + lambda
  float height;     // a_m
};

SHARED GammaPeak gamma_peak(float b, float theta_o, GammaLight light) {
  GammaPeak p;
  p.sharpness = b + light.lambda;
  p.theta = (light.lambda * light.theta - b * theta_o) / p.sharpness;
  float d = theta_o + light.theta;
  p.height = exp(-0.5f * b * light.lambda / p.sharpness * d * d);
  return p;
}

SHARED vec3 gamma_factor(FibreLobes lobes, GammaLight light, float theta, bool transmission) {
  if (transmission) {
    return gamma_factor_tt(lobes, light, theta);
  }
  return gamma_factor_r(lobes, light, theta);
}

// One lobe in closed form: the factor at the peak times the Gaussian's mass within +-pi/2.
SHARED vec3 gamma_lobe_closed(FibreLobes lobes, GammaLight light, GammaPeak peak,
                              bool transmission) {
  float root = sqrt(0.5f * peak.sharpness);
  float mass =
      error_function(root * (kHalfPi - peak.theta)) + error_function(root * (kHalfPi + peak.theta));
  float scale = peak.height * 0.5f * 1.77245385f / root * mass;
  return gamma_factor(lobes, light, peak.theta, transmission) * scale;
}

struct Gl12Node {
  float x;
  float weight;
};

// Node k = 0 ... 11 of the 12-node Gauss-Legendre rule on [-1, 1].
SHARED Gl12Node gl12_node(int k) {
  int i = k < 6 ? 5 - k : k - 6;
  float x = 0.981560634f;
  float w = 0.0471753364f;
  if (i == 0) {
    x = 0.125233409f;
    w = 0.249147046f;
  } else if (i == 1) {
    x = 0.367831499f;
    w = 0.233492537f;
  } else if (i == 2) {
    x = 0.587317954f;
    w = 0.203167427f;
  } else if (i == 3) {
    x = 0.769902674f;
    w = 0.160078329f;
  } else if (i == 4) {
    x = 0.904117256f;
    w = 0.106939326f;
  }
  Gl12Node node;
  node.x = k < 6 ? -x : x;
  node.weight = w;
  return node;
}

SHARED vec3 gamma_lobe_gl12(FibreLobes lobes, GammaLight light, GammaPeak peak, float theta_o,
                            bool transmission) {
  float reach = 4.5f * inversesqrt(peak.sharpness);
  float low = max(-kHalfPi, peak.theta - reach);
  float high = min(kHalfPi, peak.theta + reach);
  float middle = 0.5f * (low + high);
  float half_width = 0.5f * (high - low);
  float b = peak.sharpness - light.lambda;
  vec3 sum = vec3(0.0f, 0.0f, 0.0f);
  for (int k = 0; k < 12; ++k) {
    Gl12Node node = gl12_node(k);
    float theta = middle + half_width * node.x;
    float half_sine = sin_quarter(0.5f * (theta - light.theta));
    float d = theta + theta_o;
    float e = -2.0f * light.lambda * half_sine * half_sine - 0.5f * b * d * d;
    sum += gamma_factor(lobes, light, theta, transmission) * (node.weight * exp(e));
  }
  return sum * half_width;
}

SHARED vec3 gamma_lobe(FibreLobes lobes, GammaLight light, float theta_o, bool transmission,
                       int method) {
  float b = transmission ? lobes.precision_tt : lobes.precision_r;
  GammaPeak peak = gamma_peak(b, theta_o, light);
  if (peak.height < 1e-12f) {
    return vec3(0.0f, 0.0f, 0.0f);
  }
  bool closed = method == kGammaClosed;
  if (method == kGammaHybrid) {
    closed = abs(peak.theta) + 3.0f * inversesqrt(peak.sharpness) < 1.0471976f;
  }
  if (closed) {
    return gamma_lobe_closed(lobes, light, peak, transmission);
  }
  return gamma_lobe_gl12(lobes, light, peak, theta_o, transmission);
}

// The light in the coordinates of the fibre: `xi` and `omega_o` in any frame whose x axis is the
// tangent.
SHARED GammaLight gamma_light(SphericalGaussian sg, vec3 omega_o, FibreAngle o) {
  FibreAngle xi = fibre_angle(sg.axis);
  GammaLight light;
  light.lambda = sg.sharpness;
  light.theta = xi.theta;
  light.cos_theta = xi.cos_theta;
  light.cos_phi = cos_phi_between(sg.axis, xi, omega_o, o);
  return light;
}

// Gamma in RGB: the radiance that leaves along omega_o under the unnormalised Gaussian `sg`.
SHARED vec3 gamma_integral(FibreLobes lobes, SphericalGaussian sg, vec3 omega_o, int method) {
  FibreAngle o = fibre_angle(omega_o);
  GammaLight light = gamma_light(sg, omega_o, o);
  return gamma_lobe(lobes, light, o.theta, false, method) +
         gamma_lobe(lobes, light, o.theta, true, method);
}

SHARED_END

#endif
