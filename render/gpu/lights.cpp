#include "render/gpu/lights.h"

#include <variant>

#include "render/environment_fit.h"

namespace weft::render::gpu {
namespace {

using shading::DeviceLight;

struct Recorder {
  std::vector<DeviceLight>& records;

  DeviceLight& add(int kind, const glm::dvec3& place, const glm::vec3& colour) const {
    DeviceLight record{};
    record.kind = kind;
    record.place = place;
    record.colour = colour;
    return records.emplace_back(record);
  }

  void operator()(const DirectionalLight& light) const {
    add(shading::kLightDirectional, light.towards, light.irradiance);
  }
  void operator()(const SgLight& light) const {
    DeviceLight& record = add(shading::kLightGaussian, light.towards, light.irradiance);
    record.sharpness = static_cast<float>(light.sharpness);
    record.cut_at_horizon = light.cut_at_horizon ? 1 : 0;
  }
  void operator()(const PointLight& light) const {
    add(shading::kLightPoint, light.position_mm, light.intensity);
  }
  void operator()(const RectangleLight& light) const {
    DeviceLight& record = add(shading::kLightRectangle, light.corner_mm, light.radiance);
    record.edge_a = light.edge_a_mm;
    record.edge_b = light.edge_b_mm;
  }
  void operator()(const DiscLight& light) const {
    DeviceLight& record = add(shading::kLightDisc, light.centre_mm, light.radiance);
    record.edge_a = light.normal;
    record.sharpness = static_cast<float>(light.radius_mm);
  }
  void operator()(const UniformLight& light) const { (*this)(gaussian_of(light)); }
  void operator()(const EnvironmentLight& light) const {
    for (const SgLight& gaussian : fit_environment(light, {}).lights) {
      (*this)(gaussian);
    }
  }
};

}  // namespace

std::vector<DeviceLight> device_lights(const std::vector<Light>& lights) {
  std::vector<DeviceLight> records;
  for (const Light& light : lights) {
    std::visit(Recorder{records}, light);
  }
  return records;
}

}  // namespace weft::render::gpu
