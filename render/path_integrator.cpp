#include "render/path_integrator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "render/eye_surface.h"
#include "shading/fibre_bcsdf.h"
#include "transport/float_mode.h"

namespace weft::render {
namespace {

// Paths end where fibres take their light and where they leave the cloth. Lossless ones in endless
// cloth may still be long: after this many scatterings some are ended whatever they carry, which
// makes the others heavier. (After 64 it made gabardine's noise a hundred times as strong.)
constexpr std::uint32_t kPatience = 1024;
constexpr float kLongPathSurvival = 0.95f;
// Parts of a path that may wait to be followed.
constexpr std::size_t kMostPending = 64;
// Throughput times S cos(theta), in 1/sr, below which a light is asked for with a probability that
// leaves it at that: 0.05 to 0.1 make the least of variance times time, 0 takes 1.5 times as much.
// The first fibre always asks, so that what it scatters shows no noise of its own.
constexpr float kLittle = 0.1f;
// How many times as much a path at the lit side of the cloth is worth as one at the other side, but
// one. Against 0 it takes a tenth of variance times time away in gabardine, nothing in fleece.
constexpr float kWorthOfHeight = 2;

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

// Part of the light found by the way of density p, when the other way has density q.
float share_of(float p, float q) { return p > 0 ? p / (p + q) : 0; }

glm::vec3& part_of(EyeSample& seen, std::uint32_t scatterings) {
  return scatterings == 1 ? seen.single : seen.multiple;
}

// The mean direction of the light that arrives about the middle of the scene, as long as the light
// is of one direction; nothing where it comes from all around.
glm::vec3 towards_lights(const Scene& scene) {
  glm::dvec3 middle_mm(0);
  for (const auto& cloth : scene.cloths) {
    const Cloth::Bounds bounds = cloth->bounds();
    middle_mm += 0.5 * (bounds.low_mm + bounds.high_mm) / static_cast<double>(scene.cloths.size());
  }
  glm::dvec3 sum(0);
  double arriving = 0;
  for (const Light& light : scene.lights) {
    const LightSample sample = sample_light(light, middle_mm, 0.5, 0.5);
    const double brought = static_cast<double>(largest(sample.radiance)) / sample.pdf;
    sum += brought * sample.direction;
    arriving += brought;
  }
  return arriving > 0 ? glm::vec3(sum / arriving) : glm::vec3(0);
}

bool can_be_met(const Light& light) {
  return !std::holds_alternative<DirectionalLight>(light) &&
         !std::holds_alternative<PointLight>(light);
}

}  // namespace

// A scattering on a path, seen from the side of the eye.
struct PathIntegrator::Vertex {
  SceneHit hit;
  const shading::FibreBcsdf* bcsdf = nullptr;
  glm::mat3 to_fibre{1};     // from the world to omega_o-space
  glm::vec3 omega_o{0};      // in omega_o-space
  shading::LobeOdds odds{};  // of the paths that go on from here
  glm::vec3 throughput{1};   // of the path that came here
  std::uint32_t scatterings = 1;
};

// A fibre that a path has met.
struct PathIntegrator::Arrival {
  SceneHit hit;
  glm::dvec3 towards_eye{0, 0, 1};
  glm::vec3 throughput{1};
  std::uint32_t scatterings = 1;  // this one is counted
};

// A direction in which a path goes on.
struct PathIntegrator::Followed {
  Ray ray;
  glm::vec3 omega_i{0};  // in the vertex's omega_o-space
  bool reflected = false;
};

// Where a direction from a vertex leads.
struct PathIntegrator::Next {
  std::optional<SceneHit> hit;
  double end_mm = kInfinity;  // lights nearer than this are seen ...
  bool open = false;          // ... if the ray leaves the cloth where light can come from
  double exit_mm = 0;         // local paths: where it leaves; beyond, solid cloth hides lights
};

PathIntegrator::PathIntegrator(const Scene& scene, const PathSettings& settings)
    : scene_(scene),
      settings_(settings),
      limit_(settings.scattering == Scattering::kSingleOnly ? 1 : settings.max_scatterings),
      lights_can_be_met_(std::any_of(scene.lights.begin(), scene.lights.end(), can_be_met)),
      towards_lights_(towards_lights(scene)) {}

bool PathIntegrator::is_wanted(std::uint32_t scatterings) const {
  return settings_.scattering != Scattering::kMultipleOnly || scatterings > 1;
}

PathIntegrator::Vertex PathIntegrator::vertex_at(const Arrival& arrival) const {
  const SceneHit& hit = arrival.hit;
  const glm::vec3 towards_eye(arrival.towards_eye);
  const glm::vec3 omega_o = hit.fibre.to_flat * towards_eye;
  Vertex vertex;
  vertex.hit = hit;
  vertex.bcsdf =
      &scene_.cloths[hit.cloth]->fabric(hit.fibre).bcsdf_of_strand(hit.fibre.copy.strand);
  vertex.to_fibre = shading::fibre_frame(hit.fibre.tangent, omega_o) * hit.fibre.to_flat;
  vertex.omega_o = vertex.to_fibre * towards_eye;
  vertex.throughput = arrival.throughput;
  vertex.scatterings = arrival.scatterings;
  return vertex;
}

shading::LobeOdds PathIntegrator::odds_at(const Vertex& vertex, float worth,
                                          std::size_t room) const {
  shading::LobeOdds odds = vertex.bcsdf->odds(vertex.omega_o, vertex.throughput);
  odds.r *= worth;
  odds.tt *= worth;
  return odds.at_most(vertex.scatterings < kPatience ? static_cast<float>(room + 1)
                                                     : kLongPathSurvival);
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
  const glm::dvec3& point_mm = vertex.hit.fibre.world_mm;
  for (const Light& light : scene_.lights) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const LightSample sample = sample_light(light, point_mm, u1, u2);
    if (!(largest(sample.radiance) > 0) ||
        (!sample.one_direction && settings_.finding == PathSettings::Finding::kDirections)) {
      continue;
    }
    const shading::LobeDensities lobes = vertex.bcsdf->densities(
        vertex.to_fibre * glm::vec3(sample.direction), vertex.omega_o, vertex.odds);
    const bool shares = !sample.one_direction && settings_.finding == PathSettings::Finding::kBoth;
    const auto pdf = static_cast<float>(sample.pdf);
    const glm::vec3 scattered =
        vertex.throughput * (shares ? lobes.r * share_of(pdf, vertex.odds.r * lobes.pdf_r) +
                                          lobes.tt * share_of(pdf, vertex.odds.tt * lobes.pdf_tt)
                                    : lobes.r + lobes.tt);
    const float little = vertex.scatterings > 1 ? kLittle : 0;
    const float most = largest(scattered);
    if (!(most > 0) || (most < little && random.uniform() * little >= most) ||
        !reaches_light(vertex, {point_mm, sample.direction}, sample.distance_mm)) {
      continue;
    }
    sum += scattered * sample.radiance * (std::max(1.0f, little / most) / pdf);
  }
  return sum;
}

// Light that the followed direction happens to meet; the caller multiplies by the throughput.
glm::vec3 PathIntegrator::from_direction(const Vertex& vertex, const Followed& followed,
                                         const Next& next) const {
  glm::vec3 sum(0);
  if (!next.open || !lights_can_be_met_ || settings_.finding == PathSettings::Finding::kLights) {
    return sum;
  }
  const bool shares = settings_.finding == PathSettings::Finding::kBoth;
  float pdf = 0;  // of paths that go on by this lobe in this direction
  if (shares) {
    const shading::LobeDensities lobes =
        vertex.bcsdf->densities(followed.omega_i, vertex.omega_o, vertex.odds);
    pdf = followed.reflected ? vertex.odds.r * lobes.pdf_r : vertex.odds.tt * lobes.pdf_tt;
  }
  for (const Light& light : scene_.lights) {
    const std::optional<Emission> met = emission(light, followed.ray);
    if (!met || met->distance_mm > next.end_mm) {
      continue;
    }
    if (settings_.local && met->distance_mm > next.exit_mm &&
        blocked_by_cloth(scene_, {followed.ray.at(next.exit_mm), followed.ray.direction},
                         met->distance_mm - next.exit_mm)) {
      continue;
    }
    sum += met->radiance * (shares ? share_of(pdf, static_cast<float>(met->pdf)) : 1.0f);
  }
  return sum;
}

std::optional<PathIntegrator::Arrival> PathIntegrator::go_on(const Vertex& vertex, float u_lobe,
                                                             core::Random& random,
                                                             EyeSample& seen) const {
  const float u_theta = random.uniform();
  const shading::BcsdfStep step = vertex.bcsdf->scatter(
      vertex.omega_o, vertex.odds, vertex.throughput, {u_lobe, u_theta, random.uniform()});
  if (!step.survives || !(largest(step.throughput) > 0)) {
    return std::nullopt;
  }
  const glm::vec3 direction = glm::transpose(vertex.to_fibre) * step.omega_i;
  const Followed followed{{vertex.hit.fibre.world_mm, glm::normalize(glm::dvec3(direction))},
                          step.omega_i,
                          u_lobe < vertex.odds.r};
  const Next next = follow(vertex, followed.ray);
  if (is_wanted(vertex.scatterings)) {
    part_of(seen, vertex.scatterings) += step.throughput * from_direction(vertex, followed, next);
  }
  if (!next.hit || vertex.scatterings == limit_) {
    return std::nullopt;
  }
  return Arrival{*next.hit, -followed.ray.direction, step.throughput, vertex.scatterings + 1};
}

std::optional<PathIntegrator::Arrival> PathIntegrator::scatter(
    const Vertex& vertex, core::Random& random, EyeSample& seen,
    std::vector<Arrival>& pending) const {
  if (vertex.scatterings == limit_ && !lights_can_be_met_) {
    return std::nullopt;
  }
  // One number picks all, evenly spaced: neither lobe has more or fewer than it should by one.
  float u_lobe = random.uniform();
  std::optional<Arrival> first = go_on(vertex, u_lobe, random, seen);
  for (u_lobe += 1; u_lobe < vertex.odds.r + vertex.odds.tt; u_lobe += 1) {
    if (std::optional<Arrival> other = go_on(vertex, u_lobe, random, seen)) {
      pending.push_back(*other);
    }
  }
  return first;
}

float PathIntegrator::lit_from(const SceneHit& hit) const {
  return (hit.fibre.to_flat * towards_lights_).z;
}

float PathIntegrator::worth(const SceneHit& hit, float lit) const {
  const ClothFabric& fabrics = scene_.cloths[hit.cloth]->fabrics();
  const double low_mm = fabrics.low_mm();
  const auto height =
      static_cast<float>((hit.fibre.flat_mm.z - low_mm) / (fabrics.high_mm() - low_mm));
  return 1 +
         kWorthOfHeight * std::fabs(lit) * std::clamp(lit < 0 ? 1 - height : height, 0.0f, 1.0f);
}

EyeSample PathIntegrator::trace(const Ray& eye_ray, core::Random& random) const {
  const transport::FlushDenormals flush;
  const SceneMeeting first = closest(scene_, eye_ray, kInfinity, nullptr);
  if (first.fate != Fate::kFibre) {
    return {first.fate == Fate::kNothing ? scene_.background : glm::vec3(0), false};
  }
  EyeSample seen;
  describe_surface(first.hit, seen);
  const float lit = lit_from(first.hit);
  std::vector<Arrival> pending;  // parts of the path that have yet to be followed
  std::optional<Arrival> arrival = Arrival{first.hit, -eye_ray.direction, glm::vec3(1), 1};
  while (arrival) {
    Vertex vertex = vertex_at(*arrival);
    vertex.odds = odds_at(vertex, worth(vertex.hit, lit) / worth(first.hit, lit),
                          kMostPending - pending.size());
    if (is_wanted(vertex.scatterings)) {
      part_of(seen, vertex.scatterings) += from_lights(vertex, random);
    }
    arrival = scatter(vertex, random, seen, pending);
    if (!arrival && !pending.empty()) {
      arrival = pending.back();
      pending.pop_back();
    }
  }
  seen.radiance = seen.single + seen.multiple;
  if (settings_.wants_shadow) {
    seen.shadow = share_let_through(scene_, first.hit, random);
  }
  return seen;
}

}  // namespace weft::render
