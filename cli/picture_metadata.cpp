#include "cli/picture_metadata.h"

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/version.h"
#include "render/scene_description.h"

namespace weft::cli {

namespace {

constexpr const char* kSceneKey = "weft.scene";
constexpr const char* kFabricsKey = "weft.fabrics";
constexpr const char* kPixelsKey = "weft.pixels";

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions print;
  print.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, print);
  if (!status.ok()) {
    throw core::Error(core::Code::kInternal, "the scene cannot be written as JSON");
  }
  return json;
}

nlohmann::json triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

FabricIdentities fabrics_in(const std::string& text) {
  FabricIdentities fabrics;
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_object()) {
    for (const auto& [reference, identity] : json.items()) {
      if (identity.is_object()) {
        fabrics[reference] = {identity.value("name", std::string()),
                              identity.value("content_digest", std::string())};
      }
    }
  }
  return fabrics;
}

}  // namespace

std::map<std::string, std::string> recipe_of(const v1::Scene& still,
                                             const FabricIdentities& fabrics,
                                             render::ExrPixels pixels) {
  nlohmann::json identities = nlohmann::json::object();
  for (const auto& [reference, fabric] : fabrics) {
    identities[reference] = {{"name", fabric.name}, {"content_digest", fabric.content_digest}};
  }
  constexpr auto replace = nlohmann::json::error_handler_t::replace;  // a path may be no UTF-8
  return {{"weft.software", std::string("weft ") + core::version()},
          {"weft.integrator", v1::Integrator_Name(still.integration().integrator())},
          {"weft.samples_per_pixel", std::to_string(still.picture().samples_per_pixel())},
          {"weft.seed", std::to_string(still.integration().seed())},
          {kSceneKey, json_of(still)},
          {kFabricsKey, identities.dump(-1, ' ', false, replace)},
          {kPixelsKey, pixels == render::ExrPixels::kHalf ? "half" : "float"}};
}

std::map<std::string, std::string> figures_of(const render::Drawing& drawing) {
  return {{"weft.cloth_mean", triple(drawing.cloth_mean).dump()},
          {"weft.cloth_standard_error", triple(drawing.cloth_standard_error).dump()},
          {"weft.cloth_share", nlohmann::json(drawing.cloth_share).dump()},
          {"weft.mean_samples", nlohmann::json(drawing.mean_samples).dump()}};
}

bool is_drawn_from(const std::string& path, const std::map<std::string, std::string>& recipe) {
  std::map<std::string, std::string> attributes;
  try {
    attributes = render::read_exr(path).attributes;
  } catch (const core::Error&) {
    return false;
  }
  for (const auto& [name, value] : recipe) {
    const auto found = attributes.find(name);
    if (found == attributes.end() || found->second != value) {
      return false;
    }
  }
  return true;
}

RecordedPicture read_recipe(const std::string& path) {
  const std::map<std::string, std::string> attributes = render::read_exr(path).attributes;
  const auto scene = attributes.find(kSceneKey);
  if (scene == attributes.end()) {
    throw core::Error(core::Code::kInvalidArgument,
                      path +
                          ": its header does not say how it was drawn; give a picture that "
                          "'weft render' wrote");
  }
  RecordedPicture recorded;
  recorded.scene = render::parse_scene(scene->second, path + ".json", "");
  const auto fabrics = attributes.find(kFabricsKey);
  if (fabrics != attributes.end()) {
    recorded.fabrics = fabrics_in(fabrics->second);
  }
  const auto device = attributes.find("weft.device");
  if (device != attributes.end()) {
    recorded.device = device->second;
  }
  const auto pixels = attributes.find(kPixelsKey);
  if (pixels != attributes.end() && pixels->second == "float") {
    recorded.pixels = render::ExrPixels::kFloat;
  }
  return recorded;
}

}  // namespace weft::cli
