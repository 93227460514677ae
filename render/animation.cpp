#include "render/animation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/check.h"

namespace weft::render {
namespace {

namespace pb = google::protobuf;

// Where the number of a frame stands in a text.
struct Place {
  std::size_t begin = 0;
  std::size_t length = 0;
  std::size_t digits = 0;  // at least
};

std::optional<Place> place_of_number(const std::string& text) {
  const std::size_t begin = text.find('%');
  if (begin == std::string::npos || text.find('%', begin + 1) != std::string::npos) {
    return std::nullopt;
  }
  if (text.compare(begin, 2, "%d") == 0) {
    return Place{begin, 2, 0};
  }
  const bool is_padded = begin + 3 < text.size() && text[begin + 1] == '0' &&
                         text[begin + 2] >= '1' && text[begin + 2] <= '9' && text[begin + 3] == 'd';
  return is_padded ? std::optional(Place{begin, 4, static_cast<std::size_t>(text[begin + 2] - '0')})
                   : std::nullopt;
}

double mixed(double a, double b, double t) { return a + (b - a) * t; }

glm::dvec3 vector_of(const v1::Vector& v) { return {v.x(), v.y(), v.z()}; }

// Turned from a to b, the length between theirs (Shoemake 1985).
void turn(const v1::Vector& a, const v1::Vector& b, double t, v1::Vector& result) {
  const glm::dvec3 from = glm::normalize(vector_of(a));
  const glm::dvec3 to = glm::normalize(vector_of(b));
  const double angle = std::atan2(glm::length(glm::cross(from, to)), glm::dot(from, to));
  const double sine = std::sin(angle);
  const glm::dvec3 mean =
      sine > 1e-9 ? (std::sin((1 - t) * angle) * from + std::sin(t * angle) * to) / sine : from;
  const glm::dvec3 turned = mean * mixed(glm::length(vector_of(a)), glm::length(vector_of(b)), t);
  result.set_x(turned.x);
  result.set_y(turned.y);
  result.set_z(turned.z);
}

bool is_direction(const std::string& field) {
  return field == "towards" || field == "normal" || field == "up";
}

// Sets the numbers of `result`, a copy of a, between those of a and b.
void mix(const pb::Message& a, const pb::Message& b, double t, pb::Message& result) {
  const pb::Reflection& reflection = *a.GetReflection();
  std::vector<const pb::FieldDescriptor*> fields;
  reflection.ListFields(a, &fields);
  std::vector<const pb::FieldDescriptor*> others;  // a field that is 0 in one of them counts too
  reflection.ListFields(b, &others);
  fields.insert(fields.end(), others.begin(), others.end());
  std::sort(fields.begin(), fields.end());
  fields.erase(std::unique(fields.begin(), fields.end()), fields.end());
  for (const pb::FieldDescriptor* field : fields) {
    if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE) {
      const double from = reflection.GetDouble(a, field);
      const double to = reflection.GetDouble(b, field);
      const bool by_factor = field->name() == "sharpness" && from > 0 && to > 0;
      reflection.SetDouble(&result, field,
                           by_factor ? from * std::pow(to / from, t) : mixed(from, to, t));
    } else if (field->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      const pb::Message& from = reflection.GetMessage(a, field);
      const pb::Message& to = reflection.GetMessage(b, field);
      pb::Message& mean = *reflection.MutableMessage(&result, field);
      if (is_direction(field->name())) {
        turn(static_cast<const v1::Vector&>(from), static_cast<const v1::Vector&>(to), t,
             static_cast<v1::Vector&>(mean));
      } else {
        mix(from, to, t, mean);
      }
    }
  }
}

double eased(double t, v1::Interpolation interpolation) {
  switch (interpolation) {
    case v1::INTERPOLATION_EASE:
      return t * t * (3 - 2 * t);
    case v1::INTERPOLATION_HOLD:
      return t < 1 ? 0 : 1;
    default:
      return t;
  }
}

// A key's frame and what it holds.
struct Key {
  double frame;
  const pb::Message* value;
};

// What the keys have at `frame`. REQUIRES: at least one key, in the order of their frames.
void take_at(const std::vector<Key>& keys, double frame, v1::Interpolation interpolation,
             pb::Message& result) {
  const auto later =
      std::find_if(keys.begin(), keys.end(), [frame](const Key& key) { return key.frame > frame; });
  if (later == keys.begin() || later == keys.end()) {
    result.CopyFrom(*(later == keys.end() ? keys.back() : keys.front()).value);
    return;
  }
  const Key& before = *(later - 1);
  const double t = (frame - before.frame) / (later->frame - before.frame);
  result.CopyFrom(*before.value);
  mix(*before.value, *later->value, eased(t, interpolation), result);
}

std::vector<Key> keys_of_light(const v1::Animation& animation, int light) {
  std::vector<Key> keys;
  for (const v1::LightKey& key : animation.lights()) {
    if (key.light() == static_cast<std::uint32_t>(light)) {
      keys.push_back({key.frame(), &key.value()});
    }
  }
  return keys;
}

}  // namespace

std::vector<std::uint32_t> frame_numbers(const v1::Scene& scene) {
  if (!scene.has_animation()) {
    return {0};
  }
  std::vector<std::uint32_t> numbers;
  for (std::uint32_t i = 0; i < scene.animation().frames(); ++i) {
    numbers.push_back(scene.animation().first_frame() + i);
  }
  return numbers;
}

bool names_frames(const std::string& text) { return place_of_number(text).has_value(); }

std::string with_frame_number(const std::string& text, std::uint32_t frame) {
  const std::optional<Place> place = place_of_number(text);
  if (!place) {
    return text;
  }
  std::string number = std::to_string(frame);
  if (number.size() < place->digits) {
    number.insert(0, place->digits - number.size(), '0');
  }
  std::string result = text;
  return result.replace(place->begin, place->length, number);
}

v1::Scene scene_at_frame(const v1::Scene& scene, std::uint32_t frame) {
  v1::Scene still = scene;
  still.clear_animation();
  if (!scene.has_animation()) {
    return still;
  }
  const v1::Animation& animation = scene.animation();
  std::vector<Key> camera_keys;
  for (const v1::CameraKey& key : animation.camera()) {
    camera_keys.push_back({key.frame(), &key.camera()});
  }
  if (!camera_keys.empty()) {
    take_at(camera_keys, frame, animation.interpolation(), *still.mutable_camera());
  }
  for (int i = 0; i < still.lights_size(); ++i) {
    const std::vector<Key> keys = keys_of_light(animation, i);
    if (!keys.empty()) {
      take_at(keys, frame, animation.interpolation(), *still.mutable_lights(i));
    }
  }
  for (v1::Cloth& cloth : *still.mutable_cloths()) {
    if (cloth.has_shell()) {
      cloth.mutable_shell()->set_obj_file(with_frame_number(cloth.shell().obj_file(), frame));
    }
  }
  return still;
}

std::vector<std::string> files_of(const v1::Scene& scene) {
  std::set<std::string> files;
  for (const v1::Light& light : scene.lights()) {
    files.insert(light.environment().exr_file());
  }
  for (const v1::LightKey& key : scene.animation().lights()) {
    files.insert(key.value().environment().exr_file());
  }
  for (const v1::Cloth& cloth : scene.cloths()) {
    files.insert(cloth.pattern().png_file());
    for (const std::uint32_t frame : frame_numbers(scene)) {
      files.insert(scene.has_animation() ? with_frame_number(cloth.shell().obj_file(), frame)
                                         : cloth.shell().obj_file());
    }
  }
  files.erase("");
  return {files.begin(), files.end()};
}

std::vector<std::string> fabrics_of(const v1::Scene& scene) {
  std::set<std::string> fabrics;
  for (const v1::Cloth& cloth : scene.cloths()) {
    if (cloth.has_pattern()) {
      fabrics.insert(cloth.pattern().fabrics().begin(), cloth.pattern().fabrics().end());
    } else {
      fabrics.insert(cloth.fabric());
    }
  }
  return {fabrics.begin(), fabrics.end()};
}

}  // namespace weft::render
