#include "render/scene_description.h"

#include <memory>

#include "core/error.h"
#include "core/file.h"
#include "core/mistakes.h"
#include "proto/document.h"
#include "render/scene_check.h"

namespace weft::render {
namespace {

constexpr std::uint64_t kSceneLimitBytes = std::uint64_t{16} << 20;

void relative_to(const std::filesystem::path& folder, std::string& file) {
  if (!file.empty() && std::filesystem::path(file).is_relative()) {
    file = (folder / file).lexically_normal().string();
  }
}

v1::Light sg_light(double x, double y, double z, double sharpness, double irradiance) {
  v1::Light light;
  v1::SgLight& sg = *light.mutable_sg();
  sg.mutable_towards()->set_x(x);
  sg.mutable_towards()->set_y(y);
  sg.mutable_towards()->set_z(z);
  sg.set_sharpness(sharpness);
  sg.mutable_irradiance()->set_r(irradiance);
  sg.mutable_irradiance()->set_g(irradiance);
  sg.mutable_irradiance()->set_b(irradiance);
  return light;
}

}  // namespace

v1::Scene load_scene(const std::filesystem::path& path) {
  return parse_scene(core::read_file(path, kSceneLimitBytes), path.string(), path.parent_path());
}

v1::Scene parse_scene(std::string_view text, const std::string& name,
                      const std::filesystem::path& folder) {
  v1::Scene scene;
  const std::unique_ptr<v1::Document> written = v1::read_document(text, name, scene);
  core::Mistakes mistakes = written->unreadable() ? core::Mistakes{} : check_scene(scene);
  if (!written->names_fields()) {
    for (core::Mistake& mistake : mistakes) {
      mistake.message.insert(0, mistake.path + ": ");
    }
  }
  if (const std::string listing = written->listing(mistakes); !listing.empty()) {
    throw core::Error(core::Code::kInvalidArgument, listing);
  }
  for (v1::Light& light : *scene.mutable_lights()) {
    if (light.has_environment()) {
      relative_to(folder, *light.mutable_environment()->mutable_exr_file());
    }
  }
  const int keys = scene.animation().lights_size();
  for (int i = 0; i < keys; ++i) {
    v1::LightKey& key = *scene.mutable_animation()->mutable_lights(i);
    if (key.value().has_environment()) {
      relative_to(folder, *key.mutable_value()->mutable_environment()->mutable_exr_file());
    }
  }
  for (v1::Cloth& cloth : *scene.mutable_cloths()) {
    if (cloth.has_shell()) {
      relative_to(folder, *cloth.mutable_shell()->mutable_obj_file());
    }
    if (cloth.pattern().has_png_file()) {
      relative_to(folder, *cloth.mutable_pattern()->mutable_png_file());
    }
  }
  return scene;
}

v1::Scene default_scene() {
  constexpr double kKeyIrradiance = 3.0;
  constexpr double kFillIrradiance = 0.7;
  v1::Scene scene;
  *scene.add_lights() = sg_light(-0.55, 0.35, 0.75, 60, kKeyIrradiance);
  *scene.add_lights() = sg_light(0.6, -0.5, 0.7, 5, kFillIrradiance);
  v1::Cloth& cloth = *scene.add_cloths();
  cloth.mutable_flat()->set_endless(true);
  cloth.set_black_underlay(true);
  scene.set_cut_lights_at_horizon(true);
  return scene;
}

void complete_scene(v1::Scene& scene, const std::string& fabric) {
  const v1::Scene otherwise = default_scene();
  if (scene.lights_size() == 0) {
    *scene.mutable_lights() = otherwise.lights();
  }
  if (scene.cloths_size() == 0) {
    *scene.mutable_cloths() = otherwise.cloths();
  }
  for (v1::Cloth& cloth : *scene.mutable_cloths()) {
    if (cloth.has_pattern()) {
      for (std::string& name : *cloth.mutable_pattern()->mutable_fabrics()) {
        name = name.empty() ? fabric : name;
      }
    } else if (cloth.fabric().empty()) {
      cloth.set_fabric(fabric);
    }
  }
  expand_picture_defaults(scene);
}

void expand_picture_defaults(v1::Scene& scene) {
  v1::Integration& integration = *scene.mutable_integration();
  if (integration.integrator() == v1::INTEGRATOR_UNSPECIFIED) {
    integration.set_integrator(v1::INTEGRATOR_PRECOMPUTED);
  }
  v1::Picture& picture = *scene.mutable_picture();
  if (picture.width() == 0) {
    picture.set_width(512);
  }
  if (picture.height() == 0) {
    picture.set_height(512);
  }
  if (picture.samples_per_pixel() == 0) {
    // Shaded in closed form, a fibre is noiseless; paths need more.
    picture.set_samples_per_pixel(integration.integrator() == v1::INTEGRATOR_PRECOMPUTED ? 8 : 128);
  }
  if (integration.seed() == 0) {
    integration.set_seed(1);
  }
  if (integration.scattering() == v1::SCATTERING_UNSPECIFIED) {
    integration.set_scattering(v1::SCATTERING_ALL);
  }
}

}  // namespace weft::render
