#include "render/precomputed_integrator.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"
#include "render/eye_surface.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

// Draws that are given up: of a neighbour within the cloth, of a direction above its horizon.
constexpr int kMaxDraws = 32;

shading::SphericalGaussian gaussian_in(const glm::mat3& to_flat, const SgLight& light) {
  return {glm::normalize(to_flat * glm::vec3(light.towards)), static_cast<float>(light.sharpness)};
}

bool single_wanted(Scattering scattering) { return scattering != Scattering::kMultipleOnly; }
bool multiple_wanted(Scattering scattering) { return scattering != Scattering::kSingleOnly; }

}  // namespace

// A hit that is being shaded.
struct PrecomputedIntegrator::Shaded {
  const SceneHit& hit;
  const Cloth& cloth;
  const PrecomputedFabric& fabric;
  ShadingPoint point;
  glm::dvec3 top_mm;  // of the upper surface, above the hit
};

// Where light comes from: a direction, or a point of the world.
struct PrecomputedIntegrator::Arrival {
  glm::dvec3 direction{0, 0, 1};
  std::optional<glm::dvec3> point_mm;
};

// Light that comes from a drawn direction.
struct PrecomputedIntegrator::Drawn {
  LightSample sample;
  glm::vec3 omega_d;  // in the flat fabric
  glm::vec3 weight;   // radiance over density
  Arrival arrival;
};

// What one light sends to the eye.
struct PrecomputedIntegrator::Scattered {
  glm::vec3 single{0, 0, 0};
  glm::vec3 multiple{0, 0, 0};
};

PrecomputedIntegrator::PrecomputedIntegrator(const Scene& scene, Scattering scattering,
                                             bool wants_shadow, const TermSources& sources)
    : scene_(scene), scattering_(scattering), wants_shadow_(wants_shadow), sources_(sources) {
  std::size_t fabrics = 0;
  for (const auto& cloth : scene.cloths) {
    first_fabric_.push_back(fabrics);
    fabrics += cloth->fabrics().fabrics().size();
    for (const auto& fabric : cloth->fabrics().fabrics()) {
      if (sources.single != TermSource::kDatabase || sources.multiple != TermSource::kDatabase) {
        traced_.emplace_back(*fabric);
      }
      add_cells(*fabric, cloth->constant_rotation());
    }
  }
}

void PrecomputedIntegrator::add_cells(const Fabric& fabric,
                                      const std::optional<glm::mat3>& rotation) {
  const PrecomputedFabric* precomputed = fabric.precomputed();
  CHECK(precomputed != nullptr);
  for (const Light& light : scene_.lights) {
    std::optional<CellRadiance> radiance;
    const auto* directional = std::get_if<DirectionalLight>(&light);
    const auto* sg = std::get_if<SgLight>(&light);
    if (rotation && directional != nullptr) {
      radiance = precomputed->light_cells(
          harmonics_of_directional(glm::normalize(*rotation * glm::vec3(directional->towards))));
    } else if (rotation && sg != nullptr) {
      radiance = precomputed->light_cells(harmonics_of_sg(gaussian_in(*rotation, *sg)));
    }
    cells_.push_back(std::move(radiance));
  }
}

const CellRadiance* PrecomputedIntegrator::cells(const SceneHit& hit, std::size_t light) const {
  const std::optional<CellRadiance>& radiance =
      cells_[fabric_index(hit) * scene_.lights.size() + light];
  return radiance ? &*radiance : nullptr;
}

bool PrecomputedIntegrator::reaches(const glm::dvec3& from_mm, const Arrival& arrival) const {
  if (!arrival.point_mm) {
    return !blocked_by_cloth(scene_, {from_mm, arrival.direction}, kInfinity);
  }
  const glm::dvec3 way = *arrival.point_mm - from_mm;
  const double distance_mm = glm::length(way);
  return distance_mm > 0 && !blocked_by_cloth(scene_, {from_mm, way / distance_mm}, distance_mm);
}

// A point of the upper surface from the Gaussian about the hit that smooths the shadow of multiple
// scattering (section 5.3.2); points beyond the border are drawn again.
glm::dvec3 PrecomputedIntegrator::neighbour(const Shaded& at, core::Random& random) const {
  const auto sigma_mm = static_cast<double>(at.fabric.database().sigma_shadow_mm);
  for (int draw = 0; draw < kMaxDraws && sigma_mm > 0; ++draw) {
    const double radius = sigma_mm * std::sqrt(-2 * std::log1p(-random.uniform_double()));
    const double phi = 2 * kPi * random.uniform_double();
    const std::optional<glm::dvec3> point =
        at.cloth.top_point(at.hit.fibre, radius * glm::dvec2(std::cos(phi), std::sin(phi)));
    if (point) {
      return *point;
    }
  }
  return at.top_mm;
}

glm::vec3 PrecomputedIntegrator::multiple(const Shaded& at, std::size_t light,
                                          const shading::ShVector& harmonics) const {
  const CellRadiance* radiance = cells(at.hit, light);
  return radiance != nullptr ? at.fabric.multiple(at.point, *radiance)
                             : at.fabric.multiple(at.point, harmonics);
}

// Section 5.2.2: the light is shaded as if it were unoccluded by distant cloth, and scaled by the
// share of it that is. That share is of the light above the fabric's own horizon: what is below
// counts nothing in the shading already.
PrecomputedIntegrator::Scattered PrecomputedIntegrator::from_gaussian(const Shaded& at,
                                                                      std::size_t index,
                                                                      core::Random& random) const {
  const auto& light = std::get<SgLight>(scene_.lights[index]);
  const auto drawn = [&]() -> std::optional<Arrival> {
    for (int draw = 0; draw < kMaxDraws; ++draw) {
      const double u1 = random.uniform_double();
      const double u2 = random.uniform_double();
      const glm::dvec3 direction = sample_sg(light.towards, light.sharpness, u1, u2);
      if ((at.hit.fibre.to_flat * glm::vec3(direction)).z > 0) {
        return Arrival{direction, std::nullopt};
      }
    }
    return std::nullopt;
  };
  const auto lit = [&](const glm::dvec3& from_mm) {
    const std::optional<Arrival> arrival = drawn();
    return arrival && !(light.cut_at_horizon && arrival->direction.z < 0) &&
           reaches(from_mm, *arrival);
  };
  const shading::SphericalGaussian local = gaussian_in(at.hit.fibre.to_flat, light);
  Scattered sum;
  if (single_wanted(scattering_) && lit(at.top_mm)) {
    sum.single = at.fabric.single_sg(at.point, local, settings_.value_or(at.fabric.settings())) *
                 light.irradiance;
  }
  if (multiple_wanted(scattering_) && lit(neighbour(at, random))) {
    sum.multiple = multiple(at, index, harmonics_of_sg(local)) * light.irradiance;
  }
  return sum;
}

// A direction towards a light; nothing where it gives none or comes from below the flat fabric.
std::optional<PrecomputedIntegrator::Drawn> PrecomputedIntegrator::draw_direction(
    const Shaded& at, std::size_t index, core::Random& random) const {
  const double u1 = random.uniform_double();
  const double u2 = random.uniform_double();
  const LightSample sample = sample_light(scene_.lights[index], at.hit.fibre.world_mm, u1, u2);
  const glm::vec3 omega_d = glm::normalize(at.hit.fibre.to_flat * glm::vec3(sample.direction));
  if (sample.radiance == glm::vec3(0) || !(omega_d.z > 0)) {
    return std::nullopt;
  }
  Arrival arrival{sample.direction, std::nullopt};
  if (sample.distance_mm < kInfinity) {
    arrival.point_mm = at.hit.fibre.world_mm + sample.distance_mm * sample.direction;
  }
  return Drawn{sample, omega_d, sample.radiance / static_cast<float>(sample.pdf), arrival};
}

// One direction towards the light, shaded as a directional light.
PrecomputedIntegrator::Scattered PrecomputedIntegrator::from_drawn(const Shaded& at,
                                                                   std::size_t index,
                                                                   core::Random& random) const {
  const std::optional<Drawn> drawn = draw_direction(at, index, random);
  if (!drawn) {
    return {};
  }
  Scattered sum;
  if (single_wanted(scattering_)) {
    glm::vec3 single = at.fabric.single_directional(at.point, drawn->omega_d);
    if (!drawn->sample.one_direction) {  // the other part comes by directions drawn from the fibre
      const auto other = static_cast<double>(
          at.point.bcsdf->pdf(at.point.to_fibre * drawn->omega_d, at.point.omega_o));
      single *= static_cast<float>(drawn->sample.pdf / (drawn->sample.pdf + other));
    }
    if (single != glm::vec3(0) && reaches(at.top_mm, drawn->arrival)) {
      sum.single = single * drawn->weight;
    }
  }
  if (multiple_wanted(scattering_) && reaches(neighbour(at, random), drawn->arrival)) {
    sum.multiple = multiple(at, index, harmonics_of_directional(drawn->omega_d)) * drawn->weight;
  }
  return sum;
}

// Single scattering of finite lights is sharp: directions are drawn from the BCSDF too, and both
// estimates weighed against each other (Veach and Guibas 1995, balance heuristic).
glm::vec3 PrecomputedIntegrator::from_fibre_direction(const Shaded& at, const Light& light,
                                                      core::Random& random) const {
  const float u_lobe = random.uniform();
  const float u_theta = random.uniform();
  const float u_phi = random.uniform();
  const shading::BcsdfSample sample =
      at.point.bcsdf->sample(at.point.omega_o, u_lobe, u_theta, u_phi);
  if (!(sample.pdf > 0)) {
    return glm::vec3(0);
  }
  const glm::vec3 omega_d = glm::normalize(glm::transpose(at.point.to_fibre) * sample.omega_i);
  const glm::dvec3 direction =
      glm::normalize(glm::dvec3(glm::transpose(at.hit.fibre.to_flat) * omega_d));
  const std::optional<Emission> met = emission(light, {at.hit.fibre.world_mm, direction});
  if (!met || !at.fabric.sees(at.point.segment, omega_d)) {
    return glm::vec3(0);
  }
  Arrival arrival{direction, std::nullopt};
  if (met->distance_mm < kInfinity) {
    arrival.point_mm = at.hit.fibre.world_mm + met->distance_mm * direction;
  }
  if (!reaches(at.top_mm, arrival)) {
    return glm::vec3(0);
  }
  const auto pdf = static_cast<double>(sample.pdf);
  return sample.weight * met->radiance * static_cast<float>(pdf / (pdf + met->pdf));
}

// All terms by one direction towards the light.
PrecomputedIntegrator::Scattered PrecomputedIntegrator::from_traced(const Shaded& at,
                                                                    std::size_t index,
                                                                    core::Random& random) const {
  const std::optional<Drawn> drawn = draw_direction(at, index, random);
  if (!drawn) {
    return {};
  }
  const TracedTerms& traced = traced_[fabric_index(at.hit)];
  Scattered sum;
  if (single_wanted(scattering_) && reaches(at.top_mm, drawn->arrival)) {
    sum.single = traced.single(at.point, drawn->omega_d) * drawn->weight;
  }
  if (multiple_wanted(scattering_) && reaches(neighbour(at, random), drawn->arrival)) {
    sum.multiple =
        traced.multiple(at.point, drawn->omega_d, sources_.multiple, random) * drawn->weight;
  }
  return sum;
}

PrecomputedIntegrator::Scattered PrecomputedIntegrator::from_light(const Shaded& at,
                                                                   std::size_t index,
                                                                   core::Random& random) const {
  Scattered sum = from_database(at, index, random);
  if (!traced_.empty()) {
    const Scattered traced = from_traced(at, index, random);
    sum.single = sources_.single == TermSource::kDatabase ? sum.single : traced.single;
    sum.multiple = sources_.multiple == TermSource::kDatabase ? sum.multiple : traced.multiple;
  }
  return sum;
}

PrecomputedIntegrator::Scattered PrecomputedIntegrator::from_database(const Shaded& at,
                                                                      std::size_t index,
                                                                      core::Random& random) const {
  const Light& light = scene_.lights[index];
  if (std::holds_alternative<SgLight>(light)) {
    return from_gaussian(at, index, random);
  }
  Scattered sum = from_drawn(at, index, random);
  const bool one_direction =
      std::holds_alternative<DirectionalLight>(light) || std::holds_alternative<PointLight>(light);
  if (!one_direction && single_wanted(scattering_)) {
    sum.single += from_fibre_direction(at, light, random);
  }
  return sum;
}

EyeSample PrecomputedIntegrator::trace(const Ray& ray, core::Random& random) const {
  const SceneMeeting first = closest(scene_, ray, kInfinity, nullptr);
  if (first.fate != Fate::kFibre) {
    return {first.fate == Fate::kNothing ? scene_.background : glm::vec3(0), false};
  }
  const FibreHit& fibre = first.hit.fibre;
  const Cloth& cloth = *scene_.cloths[first.hit.cloth];
  const PrecomputedFabric& fabric = *cloth.fabric(fibre).precomputed();
  const glm::vec3 omega_o = glm::normalize(fibre.to_flat * glm::vec3(-ray.direction));
  const Shaded at{first.hit, cloth, fabric, fabric.point(fibre.segment, fibre.tangent, omega_o),
                  cloth.top_point(fibre, glm::dvec2(0)).value_or(fibre.world_mm)};
  EyeSample seen;
  describe_surface(first.hit, seen);
  for (std::size_t light = 0; light < scene_.lights.size(); ++light) {
    const Scattered sum = from_light(at, light, random);
    seen.single += sum.single;
    seen.multiple += sum.multiple;
  }
  seen.radiance = seen.single + seen.multiple;
  if (wants_shadow_) {
    seen.shadow = share_let_through(scene_, first.hit, random);
  }
  return seen;
}

}  // namespace weft::render
