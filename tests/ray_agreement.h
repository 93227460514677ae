#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <glm/geometric.hpp>

#include "core/random.h"
#include "transport/bake_point.h"
#include "transport/scene.h"
#include "transport/sphere.h"

// Rays as paths trace them, and whether two tracers agree about them. For tests and benchmarks.
namespace weft::test {

struct TracedRay {
  glm::vec3 origin_mm;
  glm::vec3 direction;
  std::optional<transport::StrandCopy> ignored;
};

inline glm::vec3 any_direction(core::Random& random) {
  const float u_z = random.uniform();
  return transport::uniform_direction(u_z, random.uniform());
}

// The legs of random walks: from a segment's bake point in any direction, and on from every fibre
// met, at most 16 times. `walks` of them start at each of the segments given, until there are
// `most` rays.
inline std::vector<TracedRay> rays_of_walks(const transport::Scene& scene,
                                            const std::vector<std::uint32_t>& segments,
                                            std::uint32_t walks, std::size_t most) {
  constexpr int kMostLegs = 16;
  std::vector<TracedRay> rays;
  for (const std::uint32_t segment : segments) {
    for (std::uint32_t walk = 0; walk < walks; ++walk) {
      core::Random random(77, segment, walk);
      const transport::BakePoint start = transport::bake_point(scene, segment);
      TracedRay ray{start.position_mm, any_direction(random), start.own};
      for (int leg = 0; leg < kMostLegs && rays.size() < most; ++leg) {
        rays.push_back(ray);
        const auto hit = scene.closest(ray.origin_mm, ray.direction,
                                       std::numeric_limits<float>::infinity(), ray.ignored);
        if (!hit) {
          break;
        }
        const glm::vec3 reached = ray.origin_mm + hit->t_mm * ray.direction;
        const glm::ivec2 from = scene.tile_of(ray.origin_mm);
        ray = {reached, any_direction(random),
               scene.seen_from(hit->copy, scene.tile_of(reached) - from)};
      }
    }
  }
  return rays;
}

// How many rays two tracers answered differently, and why.
struct Disagreement {
  std::uint64_t rays = 0;
  std::uint64_t hits = 0;
  std::uint64_t grazes = 0;       // the same segment, further away than rounding allows
  std::uint64_t joints = 0;       // another segment of the same fibre
  std::uint64_t fibres = 0;       // another fibre, or a fibre and none
  std::uint64_t unexplained = 0;  // of all these, ones at another distance without a close call
};

// The capsule that was hit, in double precision, where it was hit.
struct HitCapsule {
  HitCapsule(const transport::Scene& scene, const TracedRay& ray, const transport::Hit& hit)
      : origin(ray.origin_mm),
        direction(glm::normalize(glm::dvec3(ray.direction))),
        at(origin + static_cast<double>(hit.t_mm) * direction),
        middle(scene.tile().wrapped_midpoint(hit.segment)) {
    const fabric::Segment s = scene.tile().segment(hit.segment);
    half = 0.5 * glm::dvec3(s.b_mm - s.a_mm);
    radius = static_cast<double>(s.radius_mm);
    // Of all copies the one whose middle is nearest.
    for (int axis = 0; axis < 2; ++axis) {
      const double size = static_cast<double>(scene.tile().size_mm[axis]);
      middle[axis] += std::round((at[axis] - middle[axis]) / size) * size;
    }
  }

  [[nodiscard]] glm::dvec3 from_axis(const glm::dvec3& point) const {
    const double along = glm::dot(point - middle, half) / glm::dot(half, half);
    return point - (middle + std::clamp(along, -1.0, 1.0) * half);
  }

  // Rounding may decide: the ray passes the surface, or starts, within a thousandth of the radius.
  // The distance to the axis is convex along the ray; its least value is found by thirds.
  [[nodiscard]] bool is_a_close_call() const {
    const auto off = [this](double t) { return glm::length(from_axis(origin + t * direction)); };
    const double reach = 2 * glm::length(half) + 4 * radius;
    double low = glm::dot(at - origin, direction) - reach;
    double high = low + 2 * reach;
    for (int i = 0; i < 100; ++i) {
      const double third = (high - low) / 3;
      if (off(low + third) < off(high - third)) {
        high -= third;
      } else {
        low += third;
      }
    }
    return std::abs(off(low) - radius) < 1e-3 * radius || std::abs(off(0) - radius) < 1e-3 * radius;
  }

  // How far entries may differ: single precision moves surfaces by what it makes of coordinates,
  // entries by that over the cosine of incidence.
  [[nodiscard]] double allowed_shift_mm(const fabric::Tile& tile) const {
    const double surface_mm = 4e-7 * static_cast<double>(tile.size_mm.x + tile.size_mm.y);
    const double cosine = -glm::dot(glm::normalize(from_axis(at)), direction);
    return 1e-5 * glm::distance(at, origin) + surface_mm / std::max(cosine, 1e-3);
  }

  glm::dvec3 origin;
  glm::dvec3 direction;
  glm::dvec3 at;
  glm::dvec3 middle;
  glm::dvec3 half{0};
  double radius = 0;
};

// Adds what one ray was answered by the tracer under test and by the reference.
inline void compare(const transport::Scene& scene, const TracedRay& ray,
                    const std::optional<transport::Hit>& ours,
                    const std::optional<transport::Hit>& reference, Disagreement& sum) {
  ++sum.rays;
  sum.hits += ours ? 1 : 0;
  if (!ours && !reference) {
    return;
  }
  if (!ours || !reference) {
    ++sum.fibres;
    sum.unexplained += HitCapsule(scene, ray, ours ? *ours : *reference).is_a_close_call() ? 0 : 1;
    return;
  }
  const bool is_equally_far =
      std::abs(static_cast<double>(ours->t_mm) - static_cast<double>(reference->t_mm)) <
      HitCapsule(scene, ray, *ours).allowed_shift_mm(scene.tile());
  const bool explained =
      is_equally_far ||
      HitCapsule(scene, ray, ours->t_mm < reference->t_mm ? *ours : *reference).is_a_close_call();
  sum.unexplained += explained ? 0 : 1;
  if (ours->copy != reference->copy) {
    ++sum.fibres;
  } else if (ours->segment != reference->segment) {
    ++sum.joints;
  } else if (!is_equally_far) {
    ++sum.grazes;
  }
}

}  // namespace weft::test
