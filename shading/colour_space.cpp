#include "shading/colour_space.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace weft::shading {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

// The columns are the primaries in X, Y, Z, for a white of Y = 1.
glm::dmat3 xyz_of_primaries() {
  return {{0.4124564, 0.2126729, 0.0193339},
          {0.3575761, 0.7151522, 0.1191920},
          {0.1804375, 0.0721750, 0.9503041}};
}

glm::dvec3 white() { return xyz_of_primaries() * glm::dvec3(1); }

// CIE 15: cube root above (6/29)^3, a line below.
constexpr double kBend = 6.0 / 29.0;
double lab_curve(double t) {
  return t > kBend * kBend * kBend ? std::cbrt(t) : t / (3 * kBend * kBend) + 4.0 / 29.0;
}
double inverse_lab_curve(double f) {
  return f > kBend ? f * f * f : 3 * kBend * kBend * (f - 4.0 / 29.0);
}

// In degrees, 0 to 360; 0 for a colour without hue.
double hue_of(double a, double b) {
  if (a == 0 && b == 0) {
    return 0;
  }
  const double hue = std::atan2(b, a) / kDegree;
  return hue < 0 ? hue + 360 : hue;
}

// Equations 10 and 14 of Sharma et al.: the difference and the mean of two hues, in degrees.
struct Hues {
  double difference;
  double mean;
};
Hues compare_hues(double h1, double h2, bool have_hue) {
  if (!have_hue) {
    return {0, h1 + h2};
  }
  const double apart = h2 - h1;
  if (std::abs(apart) <= 180) {
    return {apart, (h1 + h2) / 2};
  }
  const double sum = h1 + h2;
  return {apart > 0 ? apart - 360 : apart + 360, (sum < 360 ? sum + 360 : sum - 360) / 2};
}

// sqrt(c^7 / (c^7 + 25^7)).
double chroma_share(double c) {
  const double c7 = std::pow(c, 7);
  return std::sqrt(c7 / (c7 + 6103515625.0));
}

}  // namespace

double srgb_from_linear(double linear) {
  const double x = std::abs(linear);
  const double y = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return std::copysign(y, linear);
}

double linear_from_srgb(double encoded) {
  const double x = std::abs(encoded);
  const double y = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  return std::copysign(y, encoded);
}

glm::dvec3 lab_from_linear(glm::dvec3 linear) {
  const glm::dvec3 t = xyz_of_primaries() * linear / white();
  const glm::dvec3 f(lab_curve(t.x), lab_curve(t.y), lab_curve(t.z));
  return {116 * f.y - 16, 500 * (f.x - f.y), 200 * (f.y - f.z)};
}

glm::dvec3 linear_from_lab(glm::dvec3 lab) {
  const double y = (lab.x + 16) / 116;
  const glm::dvec3 t(inverse_lab_curve(y + lab.y / 500), inverse_lab_curve(y),
                     inverse_lab_curve(y - lab.z / 200));
  return glm::inverse(xyz_of_primaries()) * (t * white());
}

double delta_e_2000(glm::dvec3 lab_1, glm::dvec3 lab_2) {
  // Equations 2 to 7: a is stretched where chroma is small.
  const double plain = (std::hypot(lab_1.y, lab_1.z) + std::hypot(lab_2.y, lab_2.z)) / 2;
  const double stretch = 1.5 - 0.5 * chroma_share(plain);
  const double a1 = stretch * lab_1.y;
  const double a2 = stretch * lab_2.y;
  const double c1 = std::hypot(a1, lab_1.z);
  const double c2 = std::hypot(a2, lab_2.z);
  const Hues hue = compare_hues(hue_of(a1, lab_1.z), hue_of(a2, lab_2.z), c1 * c2 != 0);

  // Equations 8 to 11.
  const double lightness = lab_2.x - lab_1.x;
  const double chroma = c2 - c1;
  const double turn = 2 * std::sqrt(c1 * c2) * std::sin(hue.difference / 2 * kDegree);

  // Equations 12 to 21.
  const double mean_c = (c1 + c2) / 2;
  const double h = hue.mean;
  const double t = 1 - 0.17 * std::cos((h - 30) * kDegree) + 0.24 * std::cos(2 * h * kDegree) +
                   0.32 * std::cos((3 * h + 6) * kDegree) - 0.20 * std::cos((4 * h - 63) * kDegree);
  const double from_blue = (h - 275) / 25;
  const double rotation =
      -std::sin(60 * std::exp(-from_blue * from_blue) * kDegree) * 2 * chroma_share(mean_c);
  const double off_grey = (lab_1.x + lab_2.x) / 2 - 50;
  const double s_l = 1 + 0.015 * off_grey * off_grey / std::sqrt(20 + off_grey * off_grey);
  const double s_c = 1 + 0.045 * mean_c;
  const double s_h = 1 + 0.015 * mean_c * t;

  // Equation 22.
  const double l = lightness / s_l;
  const double c = chroma / s_c;
  const double d = turn / s_h;
  return std::sqrt(std::max(0.0, l * l + c * c + d * d + rotation * c * d));
}

}  // namespace weft::shading
