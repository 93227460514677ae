#include "render/baselines/dual_integrator.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "render/eye_surface.h"
#include "shading/fibre_angle.h"

namespace weft::render {
namespace {

constexpr int kMaxFibres = 4096;      // in the way of one ray; more let nothing through
constexpr float kNegligible = 1e-5f;  // share of light that counts as none

float largest(const glm::vec3& v) { return std::max({v.x, v.y, v.z}); }

// The azimuth of omega_o about the fibre, less that of light which goes straight on.
float straight_azimuth(const glm::vec3& omega_i, const glm::vec3& omega_o) {
  const float cosine = -(omega_i.y * omega_o.y + omega_i.z * omega_o.z);
  const float sine = omega_i.y * omega_o.z - omega_i.z * omega_o.y;
  return std::atan2(sine, cosine);
}

}  // namespace

DualIntegrator::DualIntegrator(const Scene& scene, bool local, Scattering scattering)
    : scene_(scene), local_(local), scattering_(scattering) {
  for (const auto& cloth : scene.cloths) {
    for (const auto& fabric : cloth->fabrics().fabrics()) {
      std::vector<DualFibre>& fibres = fibres_[fabric.get()];
      if (fibres.empty()) {
        for (const shading::FibreBcsdf& bcsdf : fabric->bcsdfs()) {
          fibres.emplace_back(bcsdf);
        }
      }
    }
  }
}

const DualFibre& DualIntegrator::fibre_of(const Fabric& fabric, std::uint32_t strand) const {
  return fibres_.at(&fabric)[fabric.tile().strands[strand].material];
}

// One fibre in the way; false when nothing is left.
bool DualIntegrator::cross(const FibreHit& fibre, const Fabric& fabric, const glm::dvec3& direction,
                           Arrival& so_far) const {
  const float along = glm::dot(fibre.to_flat * glm::vec3(direction), fibre.tangent);
  const DualFibre::Averages averages =
      fibre_of(fabric, fibre.copy.strand).averages(std::asin(std::clamp(along, -1.0f, 1.0f)));
  so_far.direct = false;
  so_far.share *= averages.forward;
  so_far.variance += averages.forward_variance;
  return largest(so_far.share) > kNegligible;
}

DualIntegrator::Arrival DualIntegrator::arrival(const SceneHit& hit, const glm::dvec3& direction,
                                                double distance_mm) const {
  Arrival result{glm::vec3(1), 0, true};
  SceneHit from = hit;
  double left_mm = distance_mm;
  for (int n = 0; n < kMaxFibres; ++n) {
    const Ray ray{from.fibre.world_mm, direction};
    const Cloth& cloth = *scene_.cloths[from.cloth];
    if (local_) {
      const LocalMeeting next = cloth.closest_local(ray, from.fibre);
      if (next.t_mm >= left_mm) {
        return result;  // the light lies within the cloth
      }
      if (next.fate != LocalFate::kFibre) {
        const bool open =
            next.fate == LocalFate::kTop &&
            !blocked_by_cloth(scene_, {ray.at(next.t_mm), direction}, left_mm - next.t_mm);
        return open ? result : Arrival{};
      }
      from.fibre = next.hit;
      left_mm -= next.t_mm;
    } else {
      const SceneMeeting next = closest(scene_, ray, left_mm, &from);
      if (next.fate != Fate::kFibre) {
        return next.fate == Fate::kNothing ? result : Arrival{};
      }
      from = next.hit;
      left_mm -= next.t_mm;
    }
    if (!cross(from.fibre, scene_.cloths[from.cloth]->fabric(from.fibre), direction, result)) {
      return {};
    }
  }
  return {};
}

EyeSample DualIntegrator::trace(const Ray& eye_ray, core::Random& random) const {
  const SceneMeeting first = closest(scene_, eye_ray, kInfinity, nullptr);
  if (first.fate != Fate::kFibre) {
    return {first.fate == Fate::kNothing ? scene_.background : glm::vec3(0), false};
  }
  const FibreHit& hit = first.hit.fibre;
  const Fabric& fabric = scene_.cloths[first.hit.cloth]->fabric(hit);
  const shading::FibreBcsdf& bcsdf = fabric.bcsdf_of_strand(hit.copy.strand);
  const DualFibre& fibre = fibre_of(fabric, hit.copy.strand);
  const glm::vec3 towards_eye = hit.to_flat * glm::vec3(-eye_ray.direction);
  const glm::mat3 to_fibre = shading::fibre_frame(hit.tangent, towards_eye);
  const glm::vec3 omega_o = to_fibre * towards_eye;
  const float theta_o = shading::fibre_angle(omega_o).theta;
  EyeSample seen;
  describe_surface(first.hit, seen);
  for (const Light& light : scene_.lights) {
    const double u1 = random.uniform_double();
    const double u2 = random.uniform_double();
    const LightSample sample = sample_light(light, hit.world_mm, u1, u2);
    if (!(largest(sample.radiance) > 0)) {
      continue;
    }
    const Arrival light_left = arrival(first.hit, sample.direction, sample.distance_mm);
    if (!(largest(light_left.share) > 0)) {
      continue;
    }
    const glm::vec3 omega_d = to_fibre * (hit.to_flat * glm::vec3(sample.direction));
    const float theta_d = shading::fibre_angle(omega_d).theta;
    const float straight = straight_azimuth(omega_d, omega_o);
    const glm::vec3 weight = light_left.share * sample.radiance / static_cast<float>(sample.pdf);
    if (light_left.direct && scattering_ != Scattering::kMultipleOnly) {
      seen.single += bcsdf.evaluate_cos(omega_d, omega_o) * weight;
    }
    if (scattering_ != Scattering::kSingleOnly) {
      if (!light_left.direct) {
        seen.multiple += fibre.scattered(theta_d, theta_o, straight, light_left.variance) * weight;
      }
      seen.multiple += fibre.returned(theta_d, theta_o, straight, light_left.variance) * weight;
    }
  }
  seen.radiance = seen.single + seen.multiple;
  return seen;
}

}  // namespace weft::render
