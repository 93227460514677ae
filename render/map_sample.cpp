#include "render/map_sample.h"

#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"
#include "render/cloth.h"
#include "shading/bcsdf.h"
#include "transport/path.h"

namespace weft::render {
namespace {

constexpr int kSkyDirections = 64;
constexpr float kTwoPi = 6.28318530718f;
constexpr std::uint32_t kLongestPath = 10000;  // scatterings, as the bakers have it

// Directions of equal solid angle over the upper hemisphere: a Fibonacci lattice.
glm::vec3 sky_direction(int q) {
  constexpr float kGoldenTurn = kTwoPi * 0.61803398875f;
  const float z = (static_cast<float>(q) + 0.5f) / kSkyDirections;
  const float phi = static_cast<float>(q) * kGoldenTurn;
  const float r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}
constexpr float kSkyWeight = kTwoPi / kSkyDirections;

// S cos(theta_i) of light that nothing blocks, for both lobes.
shading::LobePair scattered(const ShadingPoint& at, glm::vec3 omega_d) {
  const glm::vec3 omega_i = at.to_fibre * omega_d;
  const shading::FibreAngle i = shading::fibre_angle(omega_i);
  const shading::FibreAngle o = shading::fibre_angle(at.omega_o);
  const shading::FibreLobes& lobes = at.bcsdf->lobes();
  shading::LobePair pair =
      shading::bcsdf_lobes(lobes, i, shading::lobe_gaussians(lobes, i.theta, o.theta),
                           shading::cos_phi_between(omega_i, i, at.omega_o, o));
  pair.r *= i.cos_theta;
  pair.tt *= i.cos_theta;
  return pair;
}

// From the axis of the segment to `point`: to that of its copies whose surface is nearest.
glm::vec3 away_from_axis(const fabric::Tile& tile, std::uint32_t segment, glm::vec3 point) {
  const fabric::Segment capsule = tile.segment(segment);
  const glm::vec3 along = capsule.b_mm - capsule.a_mm;
  const glm::vec2 middle(0.5f * (capsule.a_mm + capsule.b_mm));
  const glm::vec2 nearest = glm::round((glm::vec2(point) - middle) / tile.size_mm);
  glm::vec3 best(0, 0, 1);
  float error = std::numeric_limits<float>::infinity();
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      const glm::vec2 shift = tile.size_mm * (nearest + glm::vec2(i, j));
      const glm::vec3 from_a = point - glm::vec3(shift, 0) - capsule.a_mm;
      const float share = glm::clamp(glm::dot(from_a, along) / glm::dot(along, along), 0.0f, 1.0f);
      const glm::vec3 away = from_a - share * along;
      const float off = std::fabs(glm::length(away) - capsule.radius_mm);
      if (off < error) {
        error = off;
        best = away;
      }
    }
  }
  return best;
}

}  // namespace

MapEye::MapEye(const Fabric& fabric) : fabric_(fabric) {
  CHECK(fabric.precomputed() != nullptr);
  shading::ShVector c_light = shading::sh_zero();
  for (int q = 0; q < kSkyDirections; ++q) {
    const shading::ShVector one = harmonics_of_directional(sky_direction(q));
    for (std::size_t j = 0; j < std::size(one.c); ++j) {
      c_light.c[j] += kSkyWeight * one.c[j];
    }
  }
  sky_ = fabric.precomputed()->light_cells(c_light);
}

std::optional<MapEye::Meeting> MapEye::meet(glm::vec2 at_mm, glm::vec3 towards_eye) const {
  const fabric::Tile& tile = fabric_.tile();
  // A little above: the highest fibres touch the plane.
  const float above_mm = 0.01f * (tile.z_max_mm - tile.z_min_mm);
  const glm::vec3 origin =
      glm::vec3(at_mm, tile.z_max_mm) + (above_mm / towards_eye.z) * towards_eye;
  const std::optional<transport::Hit> hit = fabric_.scene().closest(
      origin, -towards_eye, std::numeric_limits<float>::infinity(), std::nullopt);
  if (!hit) {
    return std::nullopt;
  }
  return Meeting{hit->segment, origin - hit->t_mm * towards_eye};
}

void MapEye::light(const ShadingPoint& at, MapSample& sample) const {
  const PrecomputedFabric& precomputed = *fabric_.precomputed();
  sample.albedo = precomputed.multiple(at, sky_);
  for (int q = 0; q < kSkyDirections; ++q) {
    const glm::vec3 omega = sky_direction(q);
    if (precomputed.sees(at.segment, omega)) {
      const shading::LobePair pair = scattered(at, omega);
      sample.albedo += kSkyWeight * pair.tt;
      sample.reflected += kSkyWeight * pair.r;
    }
  }
}

std::optional<MapSample> MapEye::look(glm::vec2 at_mm, glm::vec3 towards_eye) const {
  const std::optional<Meeting> met = meet(at_mm, towards_eye);
  if (!met) {
    return std::nullopt;
  }
  MapSample sample;
  sample.z_mm = met->position_mm.z;
  sample.tangent = tangent_of(fabric_.tile(), met->segment);
  sample.normal = glm::normalize(away_from_axis(fabric_.tile(), met->segment, met->position_mm));
  const ShadingPoint at = fabric_.precomputed()->point(met->segment, sample.tangent, towards_eye);
  sample.bcsdf = at.bcsdf;
  light(at, sample);
  return sample;
}

glm::vec3 MapEye::from_below(glm::vec2 at_mm, core::Random& random) const {
  const glm::vec3 up(0, 0, 1);
  const std::optional<Meeting> met = meet(at_mm, up);
  if (!met) {
    return glm::vec3(0);
  }
  const ShadingPoint at =
      fabric_.precomputed()->point(met->segment, tangent_of(fabric_.tile(), met->segment), up);
  const float u_lobe = random.uniform();
  const float u_theta = random.uniform();
  const shading::BcsdfSample first =
      at.bcsdf->sample(at.omega_o, u_lobe, u_theta, random.uniform());
  if (!(first.pdf > 0)) {
    return glm::vec3(0);
  }
  transport::Path path(fabric_.scene(), fabric_.bcsdfs(), met->segment,
                       glm::normalize(glm::transpose(at.to_fibre) * first.omega_i));
  while (path.vertices() <= kLongestPath) {
    if (!path.advance()) {
      return path.direction().z < 0 ? first.weight * path.throughput() : glm::vec3(0);
    }
    if (!path.scatter(random)) {
      break;
    }
  }
  return glm::vec3(0);
}

}  // namespace weft::render
