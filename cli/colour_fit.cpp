#include "cli/colour_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "shading/colour_space.h"

namespace weft::cli {

namespace {

constexpr int kMostPictures = 20;
constexpr double kGoodDeltaE = 0.03;
// Strengths are from 0.0001 to 0.9999.
constexpr double kLeastStrength = 1e-4;
// Below a hundred-thousandth of white all is black.
constexpr double kBlack = 1e-5;

double logit(double x) { return std::log(x / (1 - x)); }
double strength_of(double u) { return 1 / (1 + std::exp(-u)); }

// One channel of one target: where it was measured last, and where next.
class Search {
 public:
  explicit Search(double wanted)
      : wanted_(std::log(std::max(kBlack, wanted))),
        u_(logit(std::clamp(wanted, 10 * kLeastStrength, 0.99))) {}

  [[nodiscard]] double strength() const { return strength_of(u_); }

  void advance(double shown) {
    constexpr double kLongestStep = 2.5;
    const double y = std::log(std::max(kBlack, shown));
    double slope = last_slope_;
    if (has_last_ && std::abs(u_ - last_u_) > 1e-6) {
      slope = std::clamp((y - last_y_) / (u_ - last_u_), 0.1, 4.0);
    }
    has_last_ = true;
    last_slope_ = slope;
    last_u_ = u_;
    last_y_ = y;
    const double step = std::clamp((wanted_ - y) / slope, -kLongestStep, kLongestStep);
    u_ = std::clamp(u_ + step, logit(kLeastStrength), logit(1 - kLeastStrength));
  }

 private:
  double wanted_;
  double u_;
  double last_slope_ = 0.8;
  bool has_last_ = false;
  double last_u_ = 0;
  double last_y_ = 0;
};

double rounded(double value) { return std::round(std::clamp(value, 0.0, 1.0) * 1e5) / 1e5; }

}  // namespace

Dye dye_of(const shading::FibreMaterial& material) {
  const glm::dvec3 r = material.c_r;
  const glm::dvec3 tt = material.c_tt;
  const double reflect = r.x + r.y + r.z;
  const double transmit = tt.x + tt.y + tt.z;
  const double larger = std::max(reflect, transmit);
  return larger > 0 ? Dye{reflect / larger, transmit / larger} : Dye{};
}

shading::FibreMaterial dyed(const shading::FibreMaterial& material, const Dye& dye,
                            glm::dvec3 strength) {
  shading::FibreMaterial result = material;
  for (int c = 0; c < 3; ++c) {
    result.c_r[c] = static_cast<float>(rounded(dye.reflect * strength[c]));
    result.c_tt[c] = static_cast<float>(rounded(dye.transmit * strength[c]));
  }
  return result;
}

double ColourFit::worst_delta_e() const {
  return delta_e.empty() ? 0 : *std::max_element(delta_e.begin(), delta_e.end());
}

ColourFit fit_colours(const std::vector<ColourTarget>& targets,
                      const std::vector<shading::FibreMaterial>& materials,
                      const MeasureColours& measure) {
  std::vector<std::vector<Search>> searches;
  for (const ColourTarget& target : targets) {
    searches.push_back({Search(target.linear.x), Search(target.linear.y), Search(target.linear.z)});
  }
  ColourFit best;
  double least = std::numeric_limits<double>::infinity();
  int pictures = 0;
  while (pictures < kMostPictures && least > kGoodDeltaE) {
    ColourFit fit;
    fit.materials = materials;
    for (std::size_t t = 0; t < targets.size(); ++t) {
      const glm::dvec3 strength{searches[t][0].strength(), searches[t][1].strength(),
                                searches[t][2].strength()};
      for (const std::size_t m : targets[t].materials) {
        fit.materials[m] = dyed(materials[m], dye_of(materials[m]), strength);
      }
    }
    fit.reached = measure(fit.materials);
    ++pictures;
    CHECK_EQ(fit.reached.size(), targets.size());
    for (std::size_t t = 0; t < targets.size(); ++t) {
      fit.delta_e.push_back(shading::delta_e_2000(shading::lab_from_linear(targets[t].linear),
                                                  shading::lab_from_linear(fit.reached[t])));
      for (int c = 0; c < 3; ++c) {
        searches[t][static_cast<std::size_t>(c)].advance(fit.reached[t][c]);
      }
    }
    if (fit.worst_delta_e() < least) {
      least = fit.worst_delta_e();
      best = std::move(fit);
    }
  }
  best.pictures = pictures;
  return best;
}

}  // namespace weft::cli
