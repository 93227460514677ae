#include "shading/fibre_bcsdf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "shading/azimuth_table.h"
#include "shading/bessel.h"
#include "shading/lobe_normalisation.h"
#include "shading/normal_quantile.h"

namespace weft::shading {
namespace {

// Rows over theta_o, graded like the lobe table: row i belongs to |theta_o| = pi/2 (1 - (i/n)^2).
constexpr int kRowCells = 1024;
// No sample lies closer to the axis than this; the density per solid angle stays finite.
constexpr float kCosineFloor = 1e-6f;
const float kFurnaceValue = 1.0f / (kPi * kPi);

// The Gaussian N(theta_i; -|theta_o|, beta) cut off at +-pi/2: the tails that are missing.
struct TruncatedTails {
  float low = 0;   // below -pi/2
  float high = 0;  // above +pi/2
};

struct Row {
  float share_r = 0;  // probability of the reflection lobe
  TruncatedTails r;
  TruncatedTails tt;
};

// Adjoint moments of both lobes, see lobe_normalisation.h.
struct Moments {
  float plain_r = 0;
  float schlick_r = 0;
  float plain_tt = 0;
  float schlick_tt = 0;
};

TruncatedTails tails(double theta_o, double beta) {
  const double scale = 1 / (std::numbers::sqrt2 * beta);
  TruncatedTails t;
  t.low = static_cast<float>(0.5 * std::erfc((std::numbers::pi / 2 - theta_o) * scale));
  t.high = static_cast<float>(0.5 * std::erfc((std::numbers::pi / 2 + theta_o) * scale));
  return t;
}

double luminance(glm::dvec3 c) { return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z; }

// Picking lobes by their adjoint albedos keeps the weights below 3 up to grazing angles, where
// Fresnel's factor alone would give 13.
float reflection_share(glm::dvec3 albedo_r, glm::dvec3 albedo_tt) {
  const double r = luminance(albedo_r);
  const double tt = luminance(albedo_tt);
  if (tt <= 0) {
    return 1.0f;
  }
  return r <= 0 ? 0.0f : static_cast<float>(std::clamp(r / (r + tt), 0.1, 0.9));
}

float mix_floats(float a, float b, float f) { return a + (b - a) * f; }

TruncatedTails mix_tails(TruncatedTails a, TruncatedTails b, float f) {
  return {mix_floats(a.low, b.low, f), mix_floats(a.high, b.high, f)};
}

// The angle of the truncated Gaussian at u, for theta_o of either sign.
float sample_theta(const TruncatedTails& cut, float beta, float theta_o, float u) {
  // By symmetry only theta_o >= 0 is tabulated: mirror both angles.
  const float inside = 1 - cut.low - cut.high;
  const float below = std::max(cut.low + u * inside, 0x1p-25f);
  const float above = std::max(cut.high + (1 - u) * inside, 0x1p-25f);
  const float x = below < above ? -normal_upper_quantile(below) : normal_upper_quantile(above);
  const float mirrored = -std::abs(theta_o) + beta * x;
  return std::clamp(theta_o < 0 ? -mirrored : mirrored, -kHalfPi, kHalfPi);
}

// Unit vector in the y-z plane that is phi_o = 0.
glm::vec2 azimuth_axis(glm::vec3 omega_o, float cos_theta_o) {
  return cos_theta_o < 1e-7f ? glm::vec2(1, 0) : glm::vec2(omega_o.y, omega_o.z) / cos_theta_o;
}

glm::vec3 direction(float sin_theta, float cos_theta, float phi, glm::vec2 axis) {
  const float c = std::cos(phi) * cos_theta;
  const float s = std::sin(phi) * cos_theta;
  return {sin_theta, c * axis.x - s * axis.y, c * axis.y + s * axis.x};
}

// The direction of longitude i at phi_o + pi + v, `turn` being (cos v, sin v).
glm::vec3 turned(const FibreAngle& i, glm::vec2 turn, glm::vec2 axis) {
  return {i.sin_theta, i.cos_theta * (turn.y * axis.y - turn.x * axis.x),
          -i.cos_theta * (turn.y * axis.x + turn.x * axis.y)};
}

// |v|, v = phi - pi: by its half, sin^2(v / 2) = (1 + cos phi) / 2, stable about 0.
float from_straight_on(float cos_phi) {
  const float s = std::sqrt(0.5f * (1 + cos_phi));
  const float c = std::sqrt(0.5f * (1 - cos_phi));
  return s < c ? 2 * asin_acute(std::min(s, 0.70710678f))
               : kPi - 2 * asin_acute(std::min(c, 0.70710678f));
}

float largest(glm::vec3 rgb) { return std::max({rgb.x, rgb.y, rgb.z}); }

// Where in the rows the longitude that is `pole` from the axis lies.
float row_of(float pole) {
  return std::sqrt(std::clamp(pole, 0.0f, kHalfPi) * (1 / kHalfPi)) * kRowCells;
}

struct LobeAlbedos {
  glm::vec3 r;
  glm::vec3 tt;
};

}  // namespace

struct FibreBcsdf::Tables {
  explicit Tables(const FibreMaterial& m);

  FibreMaterial material;
  bool furnace = false;
  std::vector<glm::vec2> norm;
  std::vector<Row> rows;
  std::vector<Moments> moments;  // at the rows' angles
  AzimuthTable azimuth;
  FibreLobes lobes;
  float peak_r;   // 1 / (sqrt(2 pi) beta)
  float peak_tt;  // 1 / (sqrt(2 pi) beta)

  [[nodiscard]] Row row(float at) const;
  // The adjoint albedos of both lobes.
  [[nodiscard]] LobeAlbedos albedos(float at) const;
  // Longitude of a sample of one lobe.
  [[nodiscard]] FibreAngle sample_angle(const TruncatedTails& cut, bool reflect, float theta_o,
                                        float u) const;
  // The density that sample() draws from, times cos(theta_i).
  [[nodiscard]] float density_cos(const Row& row, glm::vec2 gaussians, float azimuth_density) const;
};

FibreBcsdf::Tables::Tables(const FibreMaterial& m)
    : material(m), azimuth(1.0 / (static_cast<double>(m.gamma_tt) * m.gamma_tt)) {
  const double half_pi = std::numbers::pi / 2;
  const double root_two_pi = std::sqrt(2 * std::numbers::pi);
  const double beta_r = m.beta_r;
  const double beta_tt = m.beta_tt;
  peak_r = static_cast<float>(1 / (root_two_pi * beta_r));
  peak_tt = static_cast<float>(1 / (root_two_pi * beta_tt));
  const LobeNormalisation norm_r(beta_r);
  const LobeNormalisation norm_tt(beta_tt);
  norm.resize(kLobeTableCells + 1);
  for (std::size_t i = 0; i < norm.size(); ++i) {
    const double t = static_cast<double>(i) / kLobeTableCells;
    const double theta = half_pi * (1 - t * t);
    norm[i] = {static_cast<float>(root_two_pi * beta_r * norm_r(theta)),
               static_cast<float>(root_two_pi * beta_tt * norm_tt(theta))};
  }
  const glm::dvec3 c_r = m.c_r;
  const glm::dvec3 c_tt = m.c_tt;
  rows.resize(kRowCells + 1);
  moments.resize(kRowCells + 1);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double t = static_cast<double>(i) / kRowCells;
    const double theta = half_pi * (1 - t * t);
    const AdjointMoments r = adjoint_moments(theta, norm_r);
    const AdjointMoments tt = adjoint_moments(theta, norm_tt);
    Row& row_i = rows[i];
    row_i.share_r = reflection_share(c_r * r.plain + (1.0 - c_r) * r.schlick,
                                     c_tt * (1.0 - c_r) * (tt.plain - tt.schlick));
    row_i.r = tails(theta, beta_r);
    row_i.tt = tails(theta, beta_tt);
    moments[i] = {static_cast<float>(r.plain), static_cast<float>(r.schlick),
                  static_cast<float>(tt.plain), static_cast<float>(tt.schlick)};
  }
  lobes.c_r = m.c_r;
  lobes.c_tt = m.c_tt;
  lobes.precision_r = static_cast<float>(1 / (beta_r * beta_r));
  lobes.precision_tt = static_cast<float>(1 / (beta_tt * beta_tt));
  lobes.kappa_tt = 1 / (m.gamma_tt * m.gamma_tt);
  lobes.azimuth_norm = 1 / (kTwoPi * bessel_i0e(lobes.kappa_tt));
  lobes.table = norm.data();
}

Row FibreBcsdf::Tables::row(float at) const {
  const int i = std::min(static_cast<int>(at), kRowCells - 1);
  const float f = at - static_cast<float>(i);
  const Row& a = rows[static_cast<std::size_t>(i)];
  const Row& b = rows[static_cast<std::size_t>(i) + 1];
  return {mix_floats(a.share_r, b.share_r, f), mix_tails(a.r, b.r, f), mix_tails(a.tt, b.tt, f)};
}

LobeAlbedos FibreBcsdf::Tables::albedos(float at) const {
  const int i = std::min(static_cast<int>(at), kRowCells - 1);
  const float f = at - static_cast<float>(i);
  const Moments& a = moments[static_cast<std::size_t>(i)];
  const Moments& b = moments[static_cast<std::size_t>(i) + 1];
  const float plain_tt = mix_floats(a.plain_tt, b.plain_tt, f);
  const float schlick_tt = mix_floats(a.schlick_tt, b.schlick_tt, f);
  const glm::vec3 passed = glm::vec3(1) - material.c_r;
  return {material.c_r * mix_floats(a.plain_r, b.plain_r, f) +
              passed * mix_floats(a.schlick_r, b.schlick_r, f),
          material.c_tt * passed * (plain_tt - schlick_tt)};
}

FibreAngle FibreBcsdf::Tables::sample_angle(const TruncatedTails& cut, bool reflect, float theta_o,
                                            float u) const {
  FibreAngle i;
  i.theta = sample_theta(cut, reflect ? material.beta_r : material.beta_tt, theta_o, u);
  i.pole = kHalfPi - std::abs(i.theta);
  i.sin_theta = sin_quarter(i.theta);
  i.cos_theta = std::max(sin_quarter(i.pole), kCosineFloor);
  return i;
}

float FibreBcsdf::Tables::density_cos(const Row& at, glm::vec2 gaussians,
                                      float azimuth_density) const {
  const float r = peak_r * gaussians.x / (1 - at.r.low - at.r.high);
  const float tt = peak_tt * gaussians.y / (1 - at.tt.low - at.tt.high);
  return at.share_r * r * (1 / kTwoPi) + (1 - at.share_r) * tt * azimuth_density;
}

FibreBcsdf::FibreBcsdf(const FibreMaterial& material)
    : tables_(std::make_shared<const Tables>(material)) {}

FibreBcsdf FibreBcsdf::furnace() {
  auto tables = std::make_shared<Tables>(FibreMaterial{});
  tables->furnace = true;
  FibreBcsdf result;
  result.tables_ = std::move(tables);
  return result;
}

const FibreMaterial& FibreBcsdf::material() const { return tables_->material; }
bool FibreBcsdf::is_furnace() const { return tables_->furnace; }
const FibreLobes& FibreBcsdf::lobes() const { return tables_->lobes; }

glm::vec3 FibreBcsdf::evaluate(glm::vec3 omega_i, glm::vec3 omega_o) const {
  if (tables_->furnace) {
    return glm::vec3(kFurnaceValue);
  }
  return bcsdf(tables_->lobes, omega_i, omega_o);
}

glm::vec3 FibreBcsdf::evaluate_cos(glm::vec3 omega_i, glm::vec3 omega_o) const {
  const float cos_theta_i = std::sqrt(omega_i.y * omega_i.y + omega_i.z * omega_i.z);
  return evaluate(omega_i, omega_o) * cos_theta_i;
}

BcsdfSample FibreBcsdf::sample(glm::vec3 omega_o, float u_lobe, float u_theta, float u_phi) const {
  const Tables& t = *tables_;
  const FibreAngle o = fibre_angle(omega_o);
  const glm::vec2 axis = azimuth_axis(omega_o, o.cos_theta);
  BcsdfSample result{};
  if (t.furnace) {
    // The first coordinate of a uniform point of the disc has density (2 / pi) cos(asin x).
    const float x = std::sqrt(u_theta) * std::cos(kTwoPi * u_lobe);
    const float c = std::max(std::sqrt(std::max(0.0f, 1 - x * x)), kCosineFloor);
    result.omega_i = direction(x, c, kTwoPi * u_phi, axis);
    result.weight = glm::vec3(1);
    result.pdf = c * kFurnaceValue;
    return result;
  }
  const Row row = t.row(row_of(o.pole));
  const bool reflect = u_lobe < row.share_r;
  const FibreAngle i = t.sample_angle(reflect ? row.r : row.tt, reflect, o.theta, u_theta);
  float v;  // phi_i - phi_o - pi
  float azimuth_density;
  if (reflect) {
    v = kTwoPi * u_phi - kPi;
    azimuth_density = t.azimuth.density(v);
  } else {
    const AzimuthTable::Sample drawn = t.azimuth.sample(u_phi);
    v = drawn.v;
    azimuth_density = drawn.density;
  }
  const glm::vec2 turn = cos_sin_half(v);
  result.omega_i = turned(i, turn, axis);
  const glm::vec2 gaussians = lobe_gaussians(t.lobes, i.theta, o.theta);
  const LobePair s = bcsdf_lobes(t.lobes, i, gaussians, -turn.x);
  const float density = t.density_cos(row, gaussians, azimuth_density);
  if (!(density > 0)) {
    return result;
  }
  result.pdf = density / i.cos_theta;
  result.weight = (s.r + s.tt) * (i.cos_theta / result.pdf);
  return result;
}

LobeOdds FibreBcsdf::odds(glm::vec3 omega_o, glm::vec3 throughput) const {
  LobeOdds odds;
  if (tables_->furnace) {
    odds.tt = largest(throughput);
    return odds;
  }
  odds.o = fibre_angle(omega_o);
  odds.row = row_of(odds.o.pole);
  const LobeAlbedos kept = tables_->albedos(odds.row);
  odds.r = largest(throughput * kept.r);
  odds.tt = largest(throughput * kept.tt);
  return odds;
}

BcsdfStep FibreBcsdf::scatter(glm::vec3 omega_o, const LobeOdds& odds, glm::vec3 throughput,
                              glm::vec3 u) const {
  if (!(u.x < odds.r + odds.tt)) {
    return {};
  }
  const Tables& t = *tables_;
  if (t.furnace) {
    return {sample(omega_o, u.x / odds.tt, u.y, u.z).omega_i, throughput / odds.tt, true};
  }
  const bool reflect = u.x < odds.r;
  const Row row = t.row(odds.row);
  const TruncatedTails& cut = reflect ? row.r : row.tt;
  const FibreAngle i = t.sample_angle(cut, reflect, odds.o.theta, u.y);
  const glm::vec2 axis = azimuth_axis(omega_o, odds.o.cos_theta);
  const glm::vec2 norm = lobe_norm(t.lobes, i.pole);
  const glm::vec3 f = fresnel(t.lobes.c_r, i.cos_theta);
  // S_l cos over its density: the Gaussian cancels, and so does the circle of S_R.
  const float along = i.cos_theta * i.cos_theta * (1 - cut.low - cut.high);
  if (reflect) {
    const float weight = along / (t.peak_r * norm.x * odds.r);
    return {turned(i, cos_sin_half(kTwoPi * u.z - kPi), axis), throughput * f * weight, true};
  }
  const AzimuthTable::Sample drawn = t.azimuth.sample(u.z);
  const glm::vec2 turn = cos_sin_half(drawn.v);
  const float around =
      std::exp(-t.lobes.kappa_tt * (1 - turn.x)) * t.lobes.azimuth_norm / drawn.density;
  const float weight = along * around / (t.peak_tt * norm.y * odds.tt);
  return {turned(i, turn, axis), throughput * (glm::vec3(1) - f) * t.lobes.c_tt * weight, true};
}

LobeDensities FibreBcsdf::densities(glm::vec3 omega_i, glm::vec3 omega_o,
                                    const LobeOdds& odds) const {
  const Tables& t = *tables_;
  const FibreAngle i = fibre_angle(omega_i);
  LobeDensities lobes;
  if (t.furnace) {
    lobes.tt = glm::vec3(i.cos_theta * kFurnaceValue);
    lobes.pdf_tt = std::max(i.cos_theta, kCosineFloor) * kFurnaceValue;
    return lobes;
  }
  const glm::vec2 gaussians = lobe_gaussians(t.lobes, i.theta, odds.o.theta);
  if (!(std::max(gaussians.x, gaussians.y) > 0)) {
    return lobes;
  }
  const float cos_phi = cos_phi_between(omega_i, i, omega_o, odds.o);
  const LobePair s = bcsdf_lobes(t.lobes, i, gaussians, cos_phi);
  const Row row = t.row(odds.row);
  const float per_cos = 1 / std::max(i.cos_theta, kCosineFloor);
  lobes.r = s.r * i.cos_theta;
  lobes.tt = s.tt * i.cos_theta;
  lobes.pdf_r = per_cos * t.peak_r * gaussians.x / ((1 - row.r.low - row.r.high) * kTwoPi);
  lobes.pdf_tt = per_cos * t.peak_tt * gaussians.y / (1 - row.tt.low - row.tt.high) *
                 t.azimuth.density(from_straight_on(cos_phi));
  return lobes;
}

float FibreBcsdf::pdf(glm::vec3 omega_i, glm::vec3 omega_o) const {
  const Tables& t = *tables_;
  const FibreAngle i = fibre_angle(omega_i);
  const float cos_theta_i = std::max(i.cos_theta, kCosineFloor);
  if (t.furnace) {
    return cos_theta_i * kFurnaceValue;
  }
  const FibreAngle o = fibre_angle(omega_o);
  const float v = from_straight_on(cos_phi_between(omega_i, i, omega_o, o));
  return t.density_cos(t.row(row_of(o.pole)), lobe_gaussians(t.lobes, i.theta, o.theta),
                       t.azimuth.density(v)) /
         cos_theta_i;
}

glm::vec3 FibreBcsdf::adjoint_albedo(float theta_o) const {
  if (tables_->furnace) {
    return glm::vec3(1);
  }
  const LobeAlbedos kept = tables_->albedos(row_of(kHalfPi - std::abs(theta_o)));
  return kept.r + kept.tt;
}

}  // namespace weft::shading
