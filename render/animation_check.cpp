#include <set>
#include <string>

#include "render/animation.h"

namespace weft::render {
namespace {

namespace pb = google::protobuf;

// The fields that a message sets, those of its parts too, except numbers that may well be 0.
void collect_fields(const pb::Message& message, const std::string& path,
                    std::set<std::string>& fields) {
  static const std::set<std::string> kDefaultedNumbers = {"sharpness", "vertical_angle_deg",
                                                          "height_mm"};
  std::vector<const pb::FieldDescriptor*> listed;
  message.GetReflection()->ListFields(message, &listed);
  for (const pb::FieldDescriptor* field : listed) {
    const std::string here = path.empty() ? field->name() : path + "." + field->name();
    if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      fields.insert(here);
      collect_fields(message.GetReflection()->GetMessage(message, field), here, fields);
    } else if (field->cpp_type() != pb::FieldDescriptor::CPPTYPE_DOUBLE ||
               kDefaultedNumbers.count(field->name()) > 0) {
      fields.insert(here);
    }
  }
}

std::set<std::string> fields_of(const pb::Message& message) {
  std::set<std::string> fields;
  collect_fields(message, "", fields);
  return fields;
}

// A field that one of the two sets and the other does not; empty when there is none.
std::string differing_field(const pb::Message& a, const pb::Message& b) {
  const std::set<std::string> first = fields_of(a);
  const std::set<std::string> second = fields_of(b);
  for (const std::string& field : first) {
    if (second.count(field) == 0) {
      return field;
    }
  }
  for (const std::string& field : second) {
    if (first.count(field) == 0) {
      return field;
    }
  }
  return "";
}

class AnimationChecker {
 public:
  explicit AnimationChecker(const v1::Scene& scene)
      : scene_(scene), animation_(scene.animation()) {}

  core::Mistakes check() {
    require(animation_.frames() >= 1 && animation_.frames() <= kFrameLimit, "animation.frames",
            "out of range; give 1 to " + std::to_string(kFrameLimit));
    require(animation_.first_frame() <= 1'000'000, "animation.first_frame",
            "too large; give at most 1,000,000");
    require(v1::Interpolation_IsValid(animation_.interpolation()), "animation.interpolation",
            "no interpolation; give one of the schema's, as INTERPOLATION_LINEAR");
    check_camera_keys();
    check_light_keys();
    for (int i = 0; i < scene_.cloths_size(); ++i) {
      const std::string& file = scene_.cloths(i).shell().obj_file();
      require(file.find('%') == std::string::npos || names_frames(file),
              "cloths[" + std::to_string(i) + "].shell.obj_file",
              "no place for the number of a frame; write one %d or %04d");
    }
    return mistakes_;
  }

 private:
  void require(bool condition, const std::string& path, const std::string& what) {
    if (!condition) {
      mistakes_.push_back({path, what});
    }
  }

  void check_camera_keys() {
    for (int i = 0; i < animation_.camera_size(); ++i) {
      const std::string path = "animation.camera[" + std::to_string(i) + "]";
      const v1::CameraKey& key = animation_.camera(i);
      require(key.camera().has_position() && key.camera().has_look_at(), path,
              "a key of the camera needs a position and a look_at");
      if (i > 0) {
        check_pair(animation_.camera(i - 1).frame(), animation_.camera(i - 1).camera(), key.frame(),
                   key.camera(), path);
      }
    }
  }

  void check_light_keys() {
    for (int i = 0; i < animation_.lights_size(); ++i) {
      const std::string path = "animation.lights[" + std::to_string(i) + "]";
      const v1::LightKey& key = animation_.lights(i);
      if (key.light() >= static_cast<std::uint32_t>(scene_.lights_size())) {
        mistakes_.push_back(
            {path + ".light",
             "the scene has " + std::to_string(scene_.lights_size()) + " lights; count from 0"});
        continue;
      }
      const v1::Light& light = scene_.lights(static_cast<int>(key.light()));
      require(key.value().kind_case() == light.kind_case(), path + ".value",
              "of another kind than the light; a key changes a light's numbers only");
      for (int j = i - 1; j >= 0; --j) {
        if (animation_.lights(j).light() == key.light()) {
          check_pair(animation_.lights(j).frame(), animation_.lights(j).value(), key.frame(),
                     key.value(), path);
          break;
        }
      }
    }
  }

  void check_pair(double earlier_frame, const pb::Message& earlier, double frame,
                  const pb::Message& value, const std::string& path) {
    require(frame > earlier_frame, path + ".frame",
            "not above that of the key before; give keys in the order of their frames");
    const std::string field = differing_field(earlier, value);
    require(field.empty(), path,
            field + " is set in this key or in the one before, not in both; set it in both");
  }

  const v1::Scene& scene_;
  const v1::Animation& animation_;
  core::Mistakes mistakes_;
};

}  // namespace

core::Mistakes check_animation(const v1::Scene& scene) { return AnimationChecker(scene).check(); }

}  // namespace weft::render
