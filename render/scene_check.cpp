#include "render/scene_check.h"

#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "render/animation.h"
#include "render/environment_fit.h"
#include "render/image.h"
#include "render/read_pattern.h"

namespace weft::render {
namespace {

namespace pb = google::protobuf;

constexpr double kLengthLimitMm = 1e6;
constexpr std::uint32_t kSampleLimit = 1U << 20;

bool is_zero(const v1::Vector& v) { return v.x() == 0 && v.y() == 0 && v.z() == 0; }

// Checks one scene; each function reports at the path it is given.
class Checker {
 public:
  explicit Checker(const v1::Scene& scene) : scene_(scene) {}

  core::Mistakes check() {
    refuse_non_finite(scene_, "");
    if (!mistakes_.empty()) {
      return mistakes_;  // the other checks would list the same numbers again
    }
    if (scene_.has_camera()) {
      check_camera(scene_.camera(), "camera");
    }
    for (int i = 0; i < scene_.lights_size(); ++i) {
      check_light(scene_.lights(i), "lights[" + std::to_string(i) + "]");
    }
    for (int i = 0; i < scene_.cloths_size(); ++i) {
      check_cloth(scene_.cloths(i), "cloths[" + std::to_string(i) + "]");
    }
    check_picture(scene_.picture());
    require(scene_.integration().environment_lights() <= kMostFittedLights,
            "integration.environment_lights",
            "too many; give at most " + std::to_string(kMostFittedLights));
    require(scene_.integration().target_error() >= 0, "integration.target_error",
            "negative; give a share of the brightness, such as 0.02, or 0 for none");
    if (scene_.has_animation()) {
      check_keys(scene_.animation());
    }
    return mistakes_;
  }

 private:
  void require(bool condition, const std::string& path, const std::string& what) {
    if (!condition) {
      mistakes_.push_back({path, what});
    }
  }
  void refuse_non_finite(const pb::Message& message, const std::string& path) {
    const pb::Reflection& reflection = *message.GetReflection();
    std::vector<const pb::FieldDescriptor*> fields;
    reflection.ListFields(message, &fields);
    for (const pb::FieldDescriptor* field : fields) {
      const std::string here = path.empty() ? field->name() : path + "." + field->name();
      const bool is_message = field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE;
      if (is_message && field->is_repeated()) {
        for (int i = 0; i < reflection.FieldSize(message, field); ++i) {
          refuse_non_finite(reflection.GetRepeatedMessage(message, field, i),
                            here + "[" + std::to_string(i) + "]");
        }
      } else if (is_message) {
        refuse_non_finite(reflection.GetMessage(message, field), here);
      } else if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE) {
        require(std::isfinite(reflection.GetDouble(message, field)), here,
                "the number is not finite; give an ordinary one");
      }
    }
  }
  void direction(bool given, const v1::Vector& v, const std::string& path) {
    require(given && !is_zero(v), path,
            "no direction; give x, y, z of which one at least is not 0");
  }
  void position(const v1::Vector& v, const std::string& path) {
    require(std::fabs(v.x()) <= kLengthLimitMm && std::fabs(v.y()) <= kLengthLimitMm &&
                std::fabs(v.z()) <= kLengthLimitMm,
            path, "farther than a kilometre; give millimetres");
  }
  void length(double value, const std::string& path) {
    require(value >= 0 && value <= kLengthLimitMm, path,
            "out of range; give a length from 0 to 1000000 mm");
  }
  void colour(const v1::Colour& c, const std::string& path) {
    require(c.r() >= 0 && c.g() >= 0 && c.b() >= 0, path,
            "a negative colour; give r, g, b from 0 up");
  }

  void check_camera(const v1::Camera& camera, const std::string& path) {
    require(camera.has_position() == camera.has_look_at(), path,
            "position or look_at alone; give both, or neither to have the cloth framed");
    position(camera.position(), path + ".position");
    position(camera.look_at(), path + ".look_at");
    if (camera.has_position() && camera.has_look_at()) {
      require(camera.position().x() != camera.look_at().x() ||
                  camera.position().y() != camera.look_at().y() ||
                  camera.position().z() != camera.look_at().z(),
              path + ".look_at", "the same point as position; give another one");
    }
    if (camera.has_up()) {
      direction(true, camera.up(), path + ".up");
      check_up(camera, path + ".up");
    }
    if (camera.has_perspective()) {
      const double angle = camera.perspective().vertical_angle_deg();
      require(angle >= 0 && angle <= 170, path + ".perspective.vertical_angle_deg",
              "out of range; give an angle above 0 and up to 170 degrees");
    }
    if (camera.has_orthographic()) {
      length(camera.orthographic().height_mm(), path + ".orthographic.height_mm");
    }
  }

  void check_up(const v1::Camera& camera, const std::string& path) {
    if (!camera.has_position() || !camera.has_look_at()) {
      return;
    }
    const double dx = camera.look_at().x() - camera.position().x();
    const double dy = camera.look_at().y() - camera.position().y();
    const double dz = camera.look_at().z() - camera.position().z();
    const v1::Vector& up = camera.up();
    const double cx = dy * up.z() - dz * up.y();
    const double cy = dz * up.x() - dx * up.z();
    const double cz = dx * up.y() - dy * up.x();
    const double sine =
        std::hypot(cx, cy, cz) / (std::hypot(dx, dy, dz) * std::hypot(up.x(), up.y(), up.z()));
    require(!(sine < 1e-6), path, "along the line of sight; give a direction across it");
  }

  void check_light(const v1::Light& light, const std::string& path) {
    switch (light.kind_case()) {
      case v1::Light::kDirectional:
        direction(light.directional().has_towards(), light.directional().towards(),
                  path + ".directional.towards");
        colour(light.directional().irradiance(), path + ".directional.irradiance");
        break;
      case v1::Light::kSg:
        direction(light.sg().has_towards(), light.sg().towards(), path + ".sg.towards");
        require(light.sg().sharpness() >= 0 && light.sg().sharpness() <= 100000,
                path + ".sg.sharpness", "out of range; give a sharpness above 0 and up to 100000");
        colour(light.sg().irradiance(), path + ".sg.irradiance");
        break;
      case v1::Light::kPoint:
        require(light.point().has_position() && light.point().has_intensity(), path + ".point",
                "position or intensity missing; give both");
        position(light.point().position(), path + ".point.position");
        colour(light.point().intensity(), path + ".point.intensity");
        break;
      case v1::Light::kArea:
        check_area(light.area(), path + ".area");
        break;
      case v1::Light::kEnvironment:
        colour(light.environment().radiance(), path + ".environment.radiance");
        break;
      case v1::Light::KIND_NOT_SET:
        mistakes_.push_back(
            {path, "no kind of light; give directional, sg, point, area or environment"});
        break;
    }
  }

  void check_area(const v1::AreaLight& area, const std::string& path) {
    colour(area.radiance(), path + ".radiance");
    if (area.has_rectangle()) {
      const v1::Vector& a = area.rectangle().edge_a();
      const v1::Vector& b = area.rectangle().edge_b();
      position(area.rectangle().corner(), path + ".rectangle.corner");
      position(a, path + ".rectangle.edge_a");
      position(b, path + ".rectangle.edge_b");
      const double area_mm2 =
          std::hypot(a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(),
                     a.x() * b.y() - a.y() * b.x());
      require(area_mm2 > 1e-9, path + ".rectangle",
              "no area; give edge_a and edge_b that are not parallel");
    } else if (area.has_disc()) {
      position(area.disc().centre(), path + ".disc.centre");
      direction(area.disc().has_normal(), area.disc().normal(), path + ".disc.normal");
      require(area.disc().radius_mm() > 0 && area.disc().radius_mm() <= kLengthLimitMm,
              path + ".disc.radius_mm", "out of range; give a radius above 0 mm");
    } else {
      mistakes_.push_back({path, "no shape; give rectangle or disc"});
    }
  }

  void check_pattern(const v1::Pattern& pattern, const std::string& path) {
    require(pattern.fabrics_size() >= 1 && pattern.fabrics_size() <= kMostPatternFabrics,
            path + ".fabrics",
            "give from 1 to " + std::to_string(kMostPatternFabrics) + " fabrics");
    if (pattern.has_rows()) {
      try {
        static_cast<void>(pattern_of(pattern));
      } catch (const core::Error& error) {
        mistakes_.push_back({path + ".rows", error.what()});
      }
    } else {
      require(!pattern.png_file().empty(), path,
              "no matrix; give rows { row: \"01\" row: \"10\" } or png_file: \"...\"");
    }
  }

  void check_cloth(const v1::Cloth& cloth, const std::string& path) {
    if (cloth.has_pattern()) {
      require(cloth.fabric().empty(), path + ".fabric",
              "given beside a pattern; name the fabrics in pattern.fabrics alone");
      check_pattern(cloth.pattern(), path + ".pattern");
    }
    if (cloth.has_flat()) {
      const v1::FlatSwatch& flat = cloth.flat();
      const std::string here = path + ".flat";
      length(flat.size_x_mm(), here + ".size_x_mm");
      length(flat.size_y_mm(), here + ".size_y_mm");
      require(flat.tiles_x() >= 0 && flat.tiles_x() <= 1e6, here + ".tiles_x",
              "out of range; give a number of tiles from 0 to 1000000");
      require(flat.tiles_y() >= 0 && flat.tiles_y() <= 1e6, here + ".tiles_y",
              "out of range; give a number of tiles from 0 to 1000000");
      require(!(flat.size_x_mm() > 0 && flat.tiles_x() > 0), here + ".tiles_x",
              "the size is given twice; give size_x_mm or tiles_x");
      require(!(flat.size_y_mm() > 0 && flat.tiles_y() > 0), here + ".tiles_y",
              "the size is given twice; give size_y_mm or tiles_y");
    } else if (cloth.has_shell()) {
      const v1::ShellMesh& shell = cloth.shell();
      const std::string here = path + ".shell";
      require(!shell.obj_file().empty(), here + ".obj_file",
              "no mesh; give the path of an OBJ file with texture coordinates");
      length(shell.mesh_scale_mm(), here + ".mesh_scale_mm");
      length(shell.texture_width_mm(), here + ".texture_width_mm");
      length(shell.texture_height_mm(), here + ".texture_height_mm");
      length(shell.thickness_mm(), here + ".thickness_mm");
      position(shell.move_mm(), here + ".move_mm");
    } else {
      mistakes_.push_back({path, "no shape; give flat { } or shell { obj_file: \"...\" }"});
    }
  }

  void check_keys(const v1::Animation& animation) {
    for (int i = 0; i < animation.camera_size(); ++i) {
      check_camera(animation.camera(i).camera(),
                   "animation.camera[" + std::to_string(i) + "].camera");
    }
    for (int i = 0; i < animation.lights_size(); ++i) {
      check_light(animation.lights(i).value(), "animation.lights[" + std::to_string(i) + "].value");
    }
    const core::Mistakes further = check_animation(scene_);
    mistakes_.insert(mistakes_.end(), further.begin(), further.end());
  }

  void check_picture(const v1::Picture& picture) {
    const std::string limit = std::to_string(kImageSideLimit);
    require(picture.width() <= kImageSideLimit, "picture.width",
            "too large; give at most " + limit + " pixels");
    require(picture.height() <= kImageSideLimit, "picture.height",
            "too large; give at most " + limit + " pixels");
    require(picture.samples_per_pixel() <= kSampleLimit, "picture.samples_per_pixel",
            "too many; give at most " + std::to_string(kSampleLimit));
    colour(picture.background(), "picture.background");
    for (int i = 0; i < picture.layers_size(); ++i) {
      require(v1::PictureLayer_IsValid(picture.layers(i)) && picture.layers(i) != 0,
              "picture.layers[" + std::to_string(i) + "]",
              "no layer; name one, as PICTURE_LAYER_SINGLE");
    }
  }

  const v1::Scene& scene_;
  core::Mistakes mistakes_;
};

}  // namespace

core::Mistakes check_scene(const v1::Scene& scene) { return Checker(scene).check(); }

}  // namespace weft::render
