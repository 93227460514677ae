#include "fabric/thread_path.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "core/check.h"
#include "fabric/catmull_rom.h"

namespace weft::fabric {

namespace {

constexpr int kSubdivision = 6;  // table entries between two nodes
// Below this sine of the angle between tangent and reference the reference is no direction.
constexpr double kParallel = 1e-6;

glm::dvec3 any_across(glm::dvec3 direction) {
  const glm::dvec3 axis = std::abs(direction.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  return glm::normalize(axis - direction * glm::dot(axis, direction));
}

glm::dvec3 turn(glm::dvec3 v, glm::dvec3 axis, double angle) {
  return v * std::cos(angle) + glm::cross(axis, v) * std::sin(angle);  // v at right angles to axis
}

struct Samples {
  std::vector<YarnNode> nodes;       // dense, open: the period's end is included
  std::vector<double> distances_mm;  // along the curve
};

Samples sample_densely(const YarnCurve& curve, glm::dvec3 period) {
  const auto count = static_cast<int>(curve.nodes.size());
  const auto node = [&](int n) {
    const int turns = n < 0 ? -1 : n / count;
    YarnNode result = curve.nodes[static_cast<std::size_t>(n - turns * count)];
    result.centre_mm += period * static_cast<double>(turns);
    return result;
  };
  Samples samples;
  double distance = 0;
  for (int n = 0; n <= count; ++n) {
    const YarnNode a = node(n - 1);
    const YarnNode b = node(n);
    const YarnNode c = node(n + 1);
    const YarnNode d = node(n + 2);
    for (int k = 0; k < (n < count ? kSubdivision : 1); ++k) {
      const double f = static_cast<double>(k) / kSubdivision;
      const YarnNode at{catmull_rom(a.centre_mm, b.centre_mm, c.centre_mm, d.centre_mm, f),
                        b.half_width_mm * (1 - f) + c.half_width_mm * f,
                        b.half_height_mm * (1 - f) + c.half_height_mm * f};
      if (!samples.nodes.empty()) {
        distance += glm::distance(samples.nodes.back().centre_mm, at.centre_mm);
      }
      samples.nodes.push_back(at);
      samples.distances_mm.push_back(distance);
    }
  }
  return samples;
}

// Unit tangents of equidistant frames by central differences across the period's seam.
std::vector<glm::dvec3> tangents_of(const std::vector<YarnFrame>& frames, glm::dvec3 period) {
  const std::size_t count = frames.size() - 1;
  std::vector<glm::dvec3> tangents(frames.size());
  for (std::size_t n = 0; n < count; ++n) {
    const glm::dvec3 before =
        n == 0 ? frames[count - 1].centre_mm - period : frames[n - 1].centre_mm;
    const glm::dvec3 step = frames[n + 1].centre_mm - before;
    const double length = glm::length(step);
    tangents[n] = length > 0 ? step / length : glm::dvec3(1, 0, 0);
  }
  tangents[count] = tangents[0];
  return tangents;
}

// Warp and weft: the lateral axis is the cloth's x or -y, so that normal is +z on a level yarn.
void align_to_cloth(std::vector<YarnFrame>& frames, const std::vector<glm::dvec3>& tangents,
                    glm::dvec3 reference) {
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const glm::dvec3 across = reference - tangents[n] * glm::dot(reference, tangents[n]);
    const double length = glm::length(across);
    frames[n].lateral = length > kParallel ? across / length : any_across(tangents[n]);
    frames[n].normal = glm::cross(frames[n].lateral, tangents[n]);
  }
}

// Other curves: the frame is carried by double reflection (Wang, Juettler, Zheng, Liu 2008), then
// the angle by which it misses itself after one period is taken out evenly.
void carry_along(std::vector<YarnFrame>& frames, const std::vector<glm::dvec3>& tangents) {
  frames[0].normal = any_across(tangents[0]);
  for (std::size_t n = 0; n + 1 < frames.size(); ++n) {
    glm::dvec3 normal = frames[n].normal;
    glm::dvec3 tangent = tangents[n];
    const glm::dvec3 step = frames[n + 1].centre_mm - frames[n].centre_mm;
    const double step2 = glm::dot(step, step);
    if (step2 > 0) {
      normal -= step * (2 / step2 * glm::dot(step, normal));
      tangent -= step * (2 / step2 * glm::dot(step, tangent));
    }
    const glm::dvec3 rest = tangents[n + 1] - tangent;
    const double rest2 = glm::dot(rest, rest);
    if (rest2 > 0) {
      normal -= rest * (2 / rest2 * glm::dot(rest, normal));
    }
    normal -= tangents[n + 1] * glm::dot(normal, tangents[n + 1]);
    const double length = glm::length(normal);
    frames[n + 1].normal = length > kParallel ? normal / length : any_across(tangents[n + 1]);
  }
  const glm::dvec3 first = frames.front().normal;
  const glm::dvec3 last = frames.back().normal;
  const double missing =
      std::atan2(glm::dot(glm::cross(last, first), tangents[0]), glm::dot(last, first));
  const double count = static_cast<double>(frames.size() - 1);
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const double angle = missing * static_cast<double>(n) / count;
    frames[n].normal = turn(frames[n].normal, tangents[n], angle);
    frames[n].lateral = glm::cross(tangents[n], frames[n].normal);
  }
}

}  // namespace

ThreadPath::ThreadPath(const YarnCurve& curve, glm::dvec2 size_mm)
    : period_mm_(period_mm(curve, size_mm)) {
  CHECK_GE(curve.nodes.size(), 3U);
  const Samples samples = sample_densely(curve, period_mm_);
  length_mm_ = samples.distances_mm.back();
  const std::size_t count = samples.nodes.size() - 1;
  frames_.resize(count + 1);
  std::size_t interval = 0;
  for (std::size_t n = 0; n <= count; ++n) {
    const double distance = length_mm_ * static_cast<double>(n) / static_cast<double>(count);
    while (interval + 1 < count && samples.distances_mm[interval + 1] < distance) {
      ++interval;
    }
    const double start = samples.distances_mm[interval];
    const double step = samples.distances_mm[interval + 1] - start;
    const double f = step > 0 ? std::clamp((distance - start) / step, 0.0, 1.0) : 0.0;
    const YarnNode& a = samples.nodes[interval];
    const YarnNode& b = samples.nodes[interval + 1];
    frames_[n].centre_mm = a.centre_mm * (1 - f) + b.centre_mm * f;
    frames_[n].lateral_scale = (a.half_width_mm * (1 - f) + b.half_width_mm * f) / curve.radius_mm;
    frames_[n].normal_scale = (a.half_height_mm * (1 - f) + b.half_height_mm * f) / curve.radius_mm;
  }
  const std::vector<glm::dvec3> tangents = tangents_of(frames_, period_mm_);
  if (curve.role == Role::kWarp) {
    align_to_cloth(frames_, tangents, {1, 0, 0});
  } else if (curve.role == Role::kWeft) {
    align_to_cloth(frames_, tangents, {0, -1, 0});
  } else {
    carry_along(frames_, tangents);
  }
}

YarnFrame ThreadPath::at(double share) const {
  const double turns = std::floor(share);
  const double count = static_cast<double>(frames_.size() - 1);
  const double place = std::min((share - turns) * count, std::nextafter(count, 0.0));
  const auto n = static_cast<std::size_t>(place);
  const double f = place - static_cast<double>(n);
  const YarnFrame& a = frames_[n];
  const YarnFrame& b = frames_[n + 1];
  YarnFrame frame;
  frame.centre_mm = a.centre_mm * (1 - f) + b.centre_mm * f + period_mm_ * turns;
  const glm::dvec3 normal = a.normal * (1 - f) + b.normal * f;
  const glm::dvec3 lateral = a.lateral * (1 - f) + b.lateral * f;
  frame.normal = normal / std::max(glm::length(normal), kParallel);
  frame.lateral = lateral / std::max(glm::length(lateral), kParallel);
  frame.normal_scale = a.normal_scale * (1 - f) + b.normal_scale * f;
  frame.lateral_scale = a.lateral_scale * (1 - f) + b.lateral_scale * f;
  return frame;
}

}  // namespace weft::fabric
