#include "fabric/relax.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <glm/geometric.hpp>

#include "fabric/yarn_contact.h"

namespace weft::fabric {

namespace {

constexpr std::uint32_t kTightIterations = 120;  // at full strength of the forces
constexpr double kHalfLifeIterations = 24;       // of the forces after that
constexpr std::uint32_t kLeastIterations = 240;
// Whoever has not lost a tenth of the overlap in so many iterations never will.
constexpr std::uint32_t kPatience = 240;
constexpr double kProgress = 0.9;
constexpr std::uint32_t kMostIterations = 2400;
constexpr std::uint32_t kIterationsPerPairList = 8;
constexpr double kListMargin = 0.25;  // in the thinnest radius; what is missed shows in the end
// The forces, as shares of what would level a node with its neighbours. The shortest waves shrink
// by 1 - 2 kTension - 8/3 kBending an iteration.
constexpr double kTension = 0.20;
constexpr double kBending = 0.20;
constexpr double kAnchor = 0.02;      // back to the thread's own line in the cloth
constexpr double kPress = 0.08;       // share of an overlap taken by each section's flattening
constexpr double kSpringBack = 0.03;  // of a flattened section to its laid-out shape
constexpr double kSpread = 0.15;      // of a section towards its neighbours' mean
constexpr double kBulge = 0.05;       // towards keeping the section's area
constexpr double kPush = 1.2;         // of the mean correction of a node's contacts
// What is aimed at, below the tolerance that is promised.
constexpr double kAim = 0.6 * kOverlapTolerance;
// ... and when that has taken too long.
constexpr double kLateAim = 0.95 * kOverlapTolerance;
constexpr std::uint32_t kPatientIterations = 360;

double strength_at(std::uint32_t iteration) {
  if (iteration < kTightIterations) {
    return 1;
  }
  return std::exp2(-static_cast<double>(iteration - kTightIterations) / kHalfLifeIterations);
}

class Relaxation {
 public:
  explicit Relaxation(const YarnLayout& layout) : body_(layout), rest_(body_) {
    thinnest_ = 1e300;
    for (const YarnBody::Curve& curve : body_.curves) {
      thinnest_ = std::min(thinnest_, curve.radius_mm);
    }
  }

  RelaxReport run() {
    RelaxReport report;
    double best = 1e300;
    while (report.iterations < kMostIterations) {
      if (report.iterations % kIterationsPerPairList == 0) {
        pairs_ = near_pairs(body_, kListMargin * thinnest_);
      }
      const double strength = strength_at(report.iterations);
      straighten(strength);
      body_.update_frames();
      const double overlap = push_apart();
      smooth_sections(strength);
      ++report.iterations;
      const double aim = report.iterations < kPatientIterations ? kAim : kLateAim;
      if (report.iterations >= kLeastIterations && overlap < aim && measure() < aim) {
        break;
      }
      if (report.iterations % kPatience == 0 && report.iterations > kLeastIterations) {
        if (overlap > kProgress * best) {
          break;
        }
        best = overlap;
      }
    }
    report.overlap_share = measure();
    return report;
  }

  // The deepest overlap, with frames and pairs of their own.
  double measure() {
    body_.update_frames();
    double deepest = 0;
    for (const NearPair& pair : near_pairs(body_, 0)) {
      deepest = std::max(deepest, contact_of(body_, pair).overlap_mm / thinner_mm(pair));
    }
    return deepest;
  }

  [[nodiscard]] const YarnBody& body() const { return body_; }

 private:
  [[nodiscard]] const YarnBody::Curve& curve(std::uint32_t node) const {
    return body_.curves[body_.curve_of[node]];
  }

  [[nodiscard]] double thinner_mm(const NearPair& pair) const {
    return std::min(curve(pair.u).radius_mm, curve(pair.v).radius_mm);
  }

  [[nodiscard]] glm::dvec3 centre(std::uint32_t node, int steps) const {
    const YarnBody::Neighbour at = body_.neighbour(node, steps);
    return body_.centres_mm[at.node] + at.shift_mm;
  }

  // Tension levels a node with its two neighbours, bending with the cubic through four.
  void straighten(double strength) {
    std::vector<glm::dvec3> moved(body_.centres_mm.size());
    for (std::uint32_t n = 0; n < moved.size(); ++n) {
      const glm::dvec3 at = body_.centres_mm[n];
      const glm::dvec3 near = centre(n, -1) + centre(n, 1);
      const glm::dvec3 far = centre(n, -2) + centre(n, 2);
      const glm::dvec3 tension = 0.5 * near - at;
      const glm::dvec3 bending = (4.0 * near - far) / 6.0 - at;
      glm::dvec3 anchor = rest_.centres_mm[n] - at;
      if (curve(n).role == Role::kCurve) {
        moved[n] = at + strength * (kBending * bending + kAnchor * anchor);
        continue;
      }
      anchor.z = 0;
      moved[n] = at + strength * (kTension * tension + kBending * bending) + kAnchor * anchor;
    }
    body_.centres_mm = std::move(moved);
  }

  // Moves every node by the mean correction of its contacts, so that no order is preferred; returns
  // the deepest overlap met, in thinner radii.
  double push_apart() {
    corrections_mm_.assign(body_.centres_mm.size(), glm::dvec3(0));
    weights_.assign(body_.centres_mm.size(), 0);
    presses_mm_.assign(body_.centres_mm.size(), glm::dvec2(0));
    double deepest = 0;
    for (const NearPair& pair : pairs_) {
      const Contact contact = contact_of(body_, pair);
      if (contact.overlap_mm <= 0) {
        continue;
      }
      deepest = std::max(deepest, contact.overlap_mm / thinner_mm(pair));
      push(pair, contact);
    }
    for (std::size_t n = 0; n < weights_.size(); ++n) {
      const double share = kPush / std::max(1.0, weights_[n]);
      body_.centres_mm[n] += corrections_mm_[n] * share;
      const YarnBody::Curve& yarn = curve(static_cast<std::uint32_t>(n));
      const double least = yarn.radius_mm * (1 - yarn.flattening);
      const auto press = [least](double& half, double by) {
        half = std::max(std::min(half, least), half - by);
      };
      press(body_.half_widths_mm[n], presses_mm_[n].x);
      press(body_.half_heights_mm[n], presses_mm_[n].y);
    }
    return deepest;
  }

  void push(const NearPair& pair, const Contact& contact) {
    const double radius_u = curve(pair.u).radius_mm;
    const double radius_v = curve(pair.v).radius_mm;
    const double give_u = 1 / (radius_u * radius_u);
    const double give_v = 1 / (radius_v * radius_v);
    const double s = contact.at_u;
    const double t = contact.at_v;
    const double sum = give_u * (s * s + (1 - s) * (1 - s)) + give_v * (t * t + (1 - t) * (1 - t));
    const glm::dvec3 step = contact.normal * (contact.overlap_mm / sum);
    const auto give = [&](std::uint32_t node, double weight, const glm::dvec3& correction) {
      corrections_mm_[node] += correction * weight;
      weights_[node] += weight;
      press(node, weight, contact);
    };
    give(pair.u, 1 - s, -give_u * step);
    give(body_.neighbour(pair.u, 1).node, s, -give_u * step);
    give(pair.v, 1 - t, give_v * step);
    give(body_.neighbour(pair.v, 1).node, t, give_v * step);
  }

  void press(std::uint32_t node, double weight, const Contact& contact) {
    const YarnBody::Curve& yarn = curve(node);
    if (yarn.role != Role::kWarp && yarn.role != Role::kWeft) {
      return;
    }
    const double across = glm::dot(contact.normal, body_.laterals[node]);
    const double out = glm::dot(contact.normal, body_.normals[node]);
    const double step = kPress * contact.overlap_mm * weight;
    presses_mm_[node] += glm::dvec2(across * across, out * out) * step;
  }

  // Sections spring back and bulge while there is room, and never change abruptly.
  void smooth_sections(double strength) {
    const std::vector<double> widths = body_.half_widths_mm;
    const std::vector<double> heights = body_.half_heights_mm;
    for (std::uint32_t n = 0; n < widths.size(); ++n) {
      const std::uint32_t before = body_.neighbour(n, -1).node;
      const std::uint32_t after = body_.neighbour(n, 1).node;
      const double radius = curve(n).radius_mm;
      double width = (1 - kSpread) * widths[n] + 0.5 * kSpread * (widths[before] + widths[after]);
      double height =
          (1 - kSpread) * heights[n] + 0.5 * kSpread * (heights[before] + heights[after]);
      width += strength * kSpringBack * (rest_.half_widths_mm[n] - width);
      height += strength * kSpringBack * (rest_.half_heights_mm[n] - height);
      const double full_width = std::min(radius * radius / height, rest_.half_widths_mm[n] * 2);
      width += strength * kBulge * std::max(0.0, full_width - width);
      body_.half_widths_mm[n] = width;
      body_.half_heights_mm[n] = height;
    }
  }

  YarnBody body_;
  YarnBody rest_;
  std::vector<NearPair> pairs_;
  std::vector<glm::dvec3> corrections_mm_;
  std::vector<double> weights_;
  std::vector<glm::dvec2> presses_mm_;  // of half width and half height
  double thinnest_ = 0;
};

}  // namespace

RelaxReport relax(YarnLayout& layout) {
  if (layout.curves.empty()) {
    return {};
  }
  Relaxation relaxation(layout);
  if (layout.curves.front().role == Role::kCurve) {
    const double overlap = relaxation.measure();
    if (overlap <= kOverlapTolerance) {
      return {0, overlap};
    }
  }
  const RelaxReport report = relaxation.run();
  relaxation.body().write_to(layout);
  return report;
}

double deepest_overlap(const YarnLayout& layout) { return Relaxation(layout).measure(); }

}  // namespace weft::fabric
