#include "render/light.h"

#include <cmath>

#include <glm/geometric.hpp>

#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

bool cut(bool at_horizon, const glm::dvec3& direction) { return at_horizon && direction.z < 0; }

// From a point on a shining surface to what arrives: areas become solid angles.
LightSample sample_of_surface(const glm::dvec3& from, const glm::dvec3& to,
                              const glm::dvec3& normal, double area_mm2,
                              const glm::vec3& radiance) {
  const glm::dvec3 way = to - from;
  const double squared = glm::dot(way, way);
  LightSample sample;
  if (!(squared > 0)) {
    return sample;
  }
  sample.distance_mm = std::sqrt(squared);
  sample.direction = way / sample.distance_mm;
  const double cos_light = -glm::dot(sample.direction, normal);
  if (cos_light > 0) {
    sample.radiance = radiance;
    sample.pdf = squared / (cos_light * area_mm2);
  }
  return sample;
}

std::optional<Emission> emission_of_surface(double t_mm, double cos_light, double area_mm2,
                                            const glm::vec3& radiance) {
  return Emission{t_mm, radiance, t_mm * t_mm / (cos_light * area_mm2)};
}

// Where the ray meets the front of a plane; nothing behind it or along it.
std::optional<double> front_of_plane(const Ray& ray, const glm::dvec3& point,
                                     const glm::dvec3& normal) {
  const double cos_light = -glm::dot(ray.direction, normal);
  if (!(cos_light > 1e-12)) {
    return std::nullopt;
  }
  const double t_mm = glm::dot(ray.origin_mm - point, normal) / cos_light;
  return t_mm > 0 ? std::optional(t_mm) : std::nullopt;
}

struct Sampler {
  glm::dvec3 point_mm;
  double u1;
  double u2;

  LightSample operator()(const DirectionalLight& light) const {
    return {light.towards, kInfinity, light.irradiance, 1, true};
  }
  LightSample operator()(const SgLight& light) const {
    LightSample sample;
    sample.direction = sample_sg(light.towards, light.sharpness, u1, u2);
    sample.pdf = pdf_sg(light.towards, light.sharpness, sample.direction);
    sample.radiance = cut(light.cut_at_horizon, sample.direction)
                          ? glm::vec3(0)
                          : light.irradiance * static_cast<float>(sample.pdf);
    return sample;
  }
  LightSample operator()(const PointLight& light) const {
    const glm::dvec3 way = light.position_mm - point_mm;
    const double squared = glm::dot(way, way);
    LightSample sample;
    sample.one_direction = true;
    if (squared > 0) {
      sample.distance_mm = std::sqrt(squared);
      sample.direction = way / sample.distance_mm;
      sample.radiance = light.intensity / static_cast<float>(squared);
    }
    return sample;
  }
  LightSample operator()(const RectangleLight& light) const {
    const glm::dvec3 cross = glm::cross(light.edge_a_mm, light.edge_b_mm);
    const double area_mm2 = glm::length(cross);
    return sample_of_surface(point_mm,
                             light.corner_mm + u1 * light.edge_a_mm + u2 * light.edge_b_mm,
                             cross / area_mm2, area_mm2, light.radiance);
  }
  LightSample operator()(const DiscLight& light) const {
    const double radius = light.radius_mm * std::sqrt(u1);
    const double phi = 2.0 * kPi * u2;
    const glm::dvec3 to =
        light.centre_mm +
        from_local({radius * std::cos(phi), radius * std::sin(phi), 0}, light.normal);
    return sample_of_surface(point_mm, to, light.normal, kPi * light.radius_mm * light.radius_mm,
                             light.radiance);
  }
  LightSample operator()(const UniformLight& light) const {
    LightSample sample;
    sample.direction = sample_sphere(u1, u2);
    sample.pdf = pdf_sphere();
    if (light.cut_at_horizon) {  // the upper half alone
      sample.direction.z = std::fabs(sample.direction.z);
      sample.pdf *= 2;
    }
    sample.radiance = light.radiance;
    return sample;
  }
  LightSample operator()(const EnvironmentLight& light) const {
    LightSample sample;
    sample.direction = light.environment->sample(u1, u2);
    sample.pdf = light.environment->pdf(sample.direction);
    if (sample.pdf > 0 && !cut(light.cut_at_horizon, sample.direction)) {
      sample.radiance = light.environment->radiance(sample.direction);
    } else {
      sample.pdf = 1;
    }
    return sample;
  }
};

struct Emitter {
  Ray ray;

  std::optional<Emission> operator()(const DirectionalLight& /*light*/) const {
    return std::nullopt;
  }
  std::optional<Emission> operator()(const PointLight& /*light*/) const { return std::nullopt; }
  std::optional<Emission> operator()(const SgLight& light) const {
    if (cut(light.cut_at_horizon, ray.direction)) {
      return std::nullopt;
    }
    const double pdf = pdf_sg(light.towards, light.sharpness, ray.direction);
    return Emission{kInfinity, light.irradiance * static_cast<float>(pdf), pdf};
  }
  std::optional<Emission> operator()(const RectangleLight& light) const {
    const glm::dvec3 cross = glm::cross(light.edge_a_mm, light.edge_b_mm);
    const double area_mm2 = glm::length(cross);
    const glm::dvec3 normal = cross / area_mm2;
    const std::optional<double> t_mm = front_of_plane(ray, light.corner_mm, normal);
    if (!t_mm) {
      return std::nullopt;
    }
    // Coordinates along the edges by their dual vectors in the plane.
    const glm::dvec3 within = ray.at(*t_mm) - light.corner_mm;
    const double a = glm::dot(glm::cross(within, light.edge_b_mm), normal) / area_mm2;
    const double b = glm::dot(glm::cross(light.edge_a_mm, within), normal) / area_mm2;
    if (a < 0 || a > 1 || b < 0 || b > 1) {
      return std::nullopt;
    }
    return emission_of_surface(*t_mm, -glm::dot(ray.direction, normal), area_mm2, light.radiance);
  }
  std::optional<Emission> operator()(const DiscLight& light) const {
    const std::optional<double> t_mm = front_of_plane(ray, light.centre_mm, light.normal);
    if (!t_mm || glm::distance(ray.at(*t_mm), light.centre_mm) > light.radius_mm) {
      return std::nullopt;
    }
    return emission_of_surface(*t_mm, -glm::dot(ray.direction, light.normal),
                               kPi * light.radius_mm * light.radius_mm, light.radiance);
  }
  std::optional<Emission> operator()(const UniformLight& light) const {
    if (cut(light.cut_at_horizon, ray.direction)) {
      return std::nullopt;
    }
    return Emission{kInfinity, light.radiance, (light.cut_at_horizon ? 2 : 1) * pdf_sphere()};
  }
  std::optional<Emission> operator()(const EnvironmentLight& light) const {
    if (cut(light.cut_at_horizon, ray.direction)) {
      return std::nullopt;
    }
    return Emission{kInfinity, light.environment->radiance(ray.direction),
                    light.environment->pdf(ray.direction)};
  }
};

}  // namespace

LightSample sample_light(const Light& light, const glm::dvec3& point_mm, double u1, double u2) {
  return std::visit(Sampler{point_mm, u1, u2}, light);
}

std::optional<Emission> emission(const Light& light, const Ray& ray) {
  return std::visit(Emitter{ray}, light);
}

}  // namespace weft::render
