#include "render/path_integrator.h"

#include <algorithm>
#include <optional>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "render/eye_surface.h"
#include "shading/fibre_bcsdf.h"

namespace weft::render {
namespace {

// Single throughputs may exceed 1, for S is not reciprocal; their mean does not, so that paths end.
// After this many scatterings even a lossless path is ended now and then.
constexpr std::uint32_t kPatience = 64;
constexpr float kLongPathSurvival = 0.95f;

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

// Part of the light found by the way of density p, when the other way has density q.
float share_of(double p, double q) { return static_cast<float>(p / (p + q)); }

}  // namespace

// A scattering on a path, seen from the side of the eye.
struct PathIntegrator::Vertex {
  SceneHit hit;
  const shading::FibreBcsdf* bcsdf = nullptr;
  glm::mat3 to_fibre{1};  // from the world to omega_o-space
  glm::vec3 omega_o{0};   // in omega_o-space
};

// Where a direction from a vertex leads.
struct PathIntegrator::Next {
  std::optional<SceneHit> hit;
  double end_mm = kInfinity;  // lights nearer than this are seen ...
  bool open = false;          // ... if the ray leaves the cloth where light can come from
  double exit_mm = 0;         // local paths: where it leaves; beyond, solid cloth hides lights
};

PathIntegrator::PathIntegrator(const Scene& scene, const PathSettings& settings)
    : scene_(scene), settings_(settings) {}

PathIntegrator::Vertex PathIntegrator::vertex_at(const SceneHit& hit,
                                                 const glm::dvec3& towards_eye) const {
  const glm::vec3 omega_o = hit.fibre.to_flat * glm::vec3(towards_eye);
  Vertex vertex;
  vertex.hit = hit;
  vertex.bcsdf =
      &scene_.cloths[hit.cloth]->fabric(hit.fibre).bcsdf_of_strand(hit.fibre.copy.strand);
  vertex.to_fibre = shading::fibre_frame(hit.fibre.tangent, omega_o) * hit.fibre.to_flat;
  vertex.omega_o = vertex.to_fibre * glm::vec3(towards_eye);
  return vertex;
}

PathIntegrator::Next PathIntegrator::follow(const Vertex& vertex, const Ray& ray) const {
  Next next;
  if (settings_.local) {
    const LocalMeeting meeting =
        scene_.cloths[vertex.hit.cloth]->closest_local(ray, vertex.hit.fibre);
    if (meeting.fate == LocalFate::kFibre) {
      next.hit = SceneHit{vertex.hit.cloth, meeting.hit};
      next.end_mm = meeting.t_mm;
      next.open = true;  // a light within the cloth, before the fibre
    } else {
      next.open = meeting.fate == LocalFate::kTop;
    }
    next.exit_mm = meeting.t_mm;
    return next;
  }
  const SceneMeeting meeting = closest(scene_, ray, kInfinity, &vertex.hit);
  next.open = true;
  next.end_mm = next.exit_mm = meeting.t_mm;
  if (meeting.fate == Fate::kFibre) {
    next.hit = meeting.hit;
  }
  return next;
}

bool PathIntegrator::reaches_light(const Vertex& vertex, const Ray& ray, double distance_mm) const {
  if (!settings_.local) {
    return closest(scene_, ray, distance_mm, &vertex.hit).fate == Fate::kNothing;
  }
  const Next next = follow(vertex, ray);
  if (!next.open || distance_mm > next.end_mm) {
    return false;
  }
  return distance_mm <= next.exit_mm ||
         !blocked_by_cloth(scene_, {ray.at(next.exit_mm), ray.direction},
                           distance_mm - next.exit_mm);
}

glm::vec3 PathIntegrator::from_lights(const Vertex& vertex, core::Random& random) const {
  glm::vec3 sum(0);
  for (const Light& light : scene_.lights) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const LightSample sample = sample_light(light, vertex.hit.fibre.world_mm, u1, u2);
    if (!(largest(sample.radiance) > 0) ||
        (!sample.one_direction && settings_.finding == PathSettings::Finding::kDirections)) {
      continue;
    }
    const glm::vec3 omega_i = vertex.to_fibre * glm::vec3(sample.direction);
    const glm::vec3 scattered = vertex.bcsdf->evaluate_cos(omega_i, vertex.omega_o);
    if (!(largest(scattered) > 0) ||
        !reaches_light(vertex, {vertex.hit.fibre.world_mm, sample.direction}, sample.distance_mm)) {
      continue;
    }
    float share = 1;
    if (!sample.one_direction && settings_.finding == PathSettings::Finding::kBoth) {
      share = share_of(sample.pdf, static_cast<double>(vertex.bcsdf->pdf(omega_i, vertex.omega_o)));
    }
    sum += scattered * sample.radiance * (share / static_cast<float>(sample.pdf));
  }
  return sum;
}

// Light that the followed direction happens to meet; the caller multiplies by the BCSDF's weight.
glm::vec3 PathIntegrator::from_direction(const Next& next, const Ray& ray, double pdf) const {
  glm::vec3 sum(0);
  if (!next.open || settings_.finding == PathSettings::Finding::kLights) {
    return sum;
  }
  for (const Light& light : scene_.lights) {
    const std::optional<Emission> met = emission(light, ray);
    if (!met || met->distance_mm > next.end_mm) {
      continue;
    }
    if (settings_.local && met->distance_mm > next.exit_mm &&
        blocked_by_cloth(scene_, {ray.at(next.exit_mm), ray.direction},
                         met->distance_mm - next.exit_mm)) {
      continue;
    }
    const float share =
        settings_.finding == PathSettings::Finding::kBoth ? share_of(pdf, met->pdf) : 1.0f;
    sum += met->radiance * share;
  }
  return sum;
}

EyeSample PathIntegrator::trace(const Ray& eye_ray, core::Random& random) const {
  const SceneMeeting first = closest(scene_, eye_ray, kInfinity, nullptr);
  if (first.fate != Fate::kFibre) {
    return {first.fate == Fate::kNothing ? scene_.background : glm::vec3(0), false};
  }
  const bool single_only = settings_.scattering == Scattering::kSingleOnly;
  const std::uint32_t limit = single_only ? 1 : settings_.max_scatterings;
  EyeSample seen;
  describe_surface(first.hit, seen);
  glm::vec3 throughput(1);
  Vertex vertex = vertex_at(first.hit, -eye_ray.direction);
  for (std::uint32_t scatterings = 1;; ++scatterings) {
    glm::vec3& part = scatterings == 1 ? seen.single : seen.multiple;
    const bool counts = settings_.scattering != Scattering::kMultipleOnly || scatterings > 1;
    if (counts) {
      part += throughput * from_lights(vertex, random);
    }
    const float u_lobe = random.uniform();
    const float u_theta = random.uniform();
    const float u_phi = random.uniform();
    const shading::BcsdfSample sample =
        vertex.bcsdf->sample(vertex.omega_o, u_lobe, u_theta, u_phi);
    if (!(sample.pdf > 0) || !(largest(sample.weight) > 0)) {
      break;
    }
    throughput *= sample.weight;
    // Roulette, so that what goes on is of weight about one.
    const float survival =
        std::min(scatterings < kPatience ? 1.0f : kLongPathSurvival, largest(throughput));
    if (random.uniform() >= survival) {
      break;
    }
    throughput /= survival;
    const glm::vec3 direction = glm::transpose(vertex.to_fibre) * sample.omega_i;
    const Ray ray{vertex.hit.fibre.world_mm, glm::normalize(glm::dvec3(direction))};
    const Next next = follow(vertex, ray);
    if (counts) {
      part += throughput * from_direction(next, ray, static_cast<double>(sample.pdf));
    }
    if (!next.hit || (limit > 0 && scatterings >= limit)) {
      break;
    }
    vertex = vertex_at(*next.hit, -ray.direction);
  }
  seen.radiance = seen.single + seen.multiple;
  if (settings_.wants_shadow) {
    seen.shadow = share_let_through(scene_, first.hit, random);
  }
  return seen;
}

}  // namespace weft::render
