#include "coordinator/web/swatch_view.h"

#include <charconv>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "core/error.h"

namespace weft::coordinator {

namespace {

// Of the light's and the fill's irradiance on a plane that faces them: as weft's default scene.
constexpr double kIrradiance = 3.0;
constexpr double kFillIrradiance = 0.7;
constexpr double kFillSharpness = 5;
constexpr double kFillElevationDeg = 42;
constexpr double kDistanceMm = 100;  // of an orthographic camera: any that is outside the cloth
constexpr double kRadians = std::numbers::pi / 180;

double number_from(const std::string& text, const char* field, double least, double most) {
  double value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failure != std::errc() || end != text.data() + text.size() || !(value >= least) ||
      !(value <= most)) {
    throw core::Error(
        core::Code::kInvalidArgument,
        fmt::format("{} is '{}'; it is a number from {} to {}", field, text, least, most));
  }
  return value;
}

v1::Scattering scattering_from(const std::string& text) {
  if (text == "all") {
    return v1::SCATTERING_ALL;
  }
  if (text == "single") {
    return v1::SCATTERING_SINGLE_ONLY;
  }
  if (text == "multiple") {
    return v1::SCATTERING_MULTIPLE_ONLY;
  }
  throw core::Error(core::Code::kInvalidArgument,
                    "scattering is '" + text + "'; it is all, single or multiple");
}

void set(v1::Vector& vector, double azimuth_deg, double elevation_deg, double length) {
  const double azimuth = azimuth_deg * kRadians;
  const double elevation = elevation_deg * kRadians;
  vector.set_x(length * std::cos(elevation) * std::cos(azimuth));
  vector.set_y(length * std::cos(elevation) * std::sin(azimuth));
  vector.set_z(length * std::sin(elevation));
}

void set(v1::Colour& colour, double grey) {
  colour.set_r(grey);
  colour.set_g(grey);
  colour.set_b(grey);
}

void add_gaussian(v1::Scene& scene, double azimuth_deg, double elevation_deg, double sharpness,
                  double irradiance) {
  v1::SgLight& light = *scene.add_lights()->mutable_sg();
  set(*light.mutable_towards(), azimuth_deg, elevation_deg, 1);
  light.set_sharpness(sharpness);
  set(*light.mutable_irradiance(), irradiance);
}

}  // namespace

SwatchView swatch_view_from(const std::map<std::string, std::string>& query) {
  SwatchView view;
  const auto take = [&](const char* field, double least, double most, double& value) {
    if (const auto found = query.find(field); found != query.end()) {
      value = number_from(found->second, field, least, most);
    }
  };
  const auto take_count = [&](const char* field, double least, double most, std::uint32_t& value) {
    auto number = static_cast<double>(value);
    take(field, least, most, number);
    value = static_cast<std::uint32_t>(number);
  };
  const auto text_of = [&](const char* field) -> std::string {
    const auto found = query.find(field);
    return found == query.end() ? std::string() : found->second;
  };
  take("light_azimuth", -360, 360, view.light_azimuth_deg);
  take("light_elevation", 2, 90, view.light_elevation_deg);
  take("camera_azimuth", -360, 360, view.camera_azimuth_deg);
  take("camera_elevation", 15, 90, view.camera_elevation_deg);
  take("height", 0.2, 50, view.height_mm);
  take_count("size", 16, 640, view.size);
  take_count("samples", 1, 32, view.samples);
  if (text_of("sharpness") == "parallel") {
    view.sharpness = 0;
  } else {
    take("sharpness", 1, 10'000, view.sharpness);
  }
  if (const std::string scattering = text_of("scattering"); !scattering.empty()) {
    view.scattering = scattering_from(scattering);
  }
  double fill = view.fill ? 1 : 0;
  take("fill", 0, 1, fill);
  view.fill = fill > 0;
  if (const std::string stops = text_of("stops"); !stops.empty() && stops != "auto") {
    view.stops = static_cast<float>(number_from(stops, "stops", -20, 20));
  }
  return view;
}

v1::Scene scene_of(const SwatchView& view, const std::string& reference) {
  v1::Scene scene;
  v1::Camera& camera = *scene.mutable_camera();
  set(*camera.mutable_position(), view.camera_azimuth_deg, view.camera_elevation_deg, kDistanceMm);
  camera.mutable_look_at();
  // What is further up in the picture is further away, also when looking straight down.
  set(*camera.mutable_up(), view.camera_azimuth_deg + 180, 90 - view.camera_elevation_deg, 1);
  camera.mutable_orthographic()->set_height_mm(view.height_mm);
  if (view.sharpness > 0) {
    add_gaussian(scene, view.light_azimuth_deg, view.light_elevation_deg, view.sharpness,
                 kIrradiance);
  } else {
    v1::DirectionalLight& light = *scene.add_lights()->mutable_directional();
    set(*light.mutable_towards(), view.light_azimuth_deg, view.light_elevation_deg, 1);
    set(*light.mutable_irradiance(), kIrradiance);
  }
  if (view.fill) {
    add_gaussian(scene, view.light_azimuth_deg + 180, kFillElevationDeg, kFillSharpness,
                 kFillIrradiance);
  }
  scene.set_cut_lights_at_horizon(true);
  v1::Cloth& cloth = *scene.add_cloths();
  cloth.set_fabric(reference);
  cloth.mutable_flat()->set_endless(true);
  cloth.set_black_underlay(true);
  v1::Picture& picture = *scene.mutable_picture();
  picture.set_width(view.size);
  picture.set_height(view.size);
  picture.set_samples_per_pixel(view.samples);
  v1::Integration& integration = *scene.mutable_integration();
  integration.set_integrator(v1::INTEGRATOR_PRECOMPUTED);
  integration.set_scattering(view.scattering);
  integration.set_seed(1);
  return scene;
}

}  // namespace weft::coordinator
