#include "bench/picture_request.h"

#include <utility>

#include "core/error.h"
#include "render/scene_description.h"
#include "storage/fabric_database.h"
#include "storage/reduce.h"

namespace weft::bench {
namespace {

FabricChoice parse_fabric(const nlohmann::json& json) {
  FabricChoice choice;
  choice.path = json.at("fabric").get<std::string>();
  const auto reduce = json.find("reduce");
  if (reduce == json.end()) {
    return choice;
  }
  if (reduce->contains("sh_order")) {
    choice.sh_order = reduce->at("sh_order").get<std::uint32_t>();
  }
  if (reduce->contains("components")) {
    choice.components = reduce->at("components").get<std::uint32_t>();
  }
  choice.half = reduce->value("half", false);
  if (reduce->contains("blend")) {
    choice.blend_low = reduce->at("blend").at(0).get<float>();
    choice.blend_high = reduce->at("blend").at(1).get<float>();
  }
  return choice;
}

}  // namespace

PictureRequest parse_request(const std::string& line) {
  PictureRequest request;
  try {
    const nlohmann::json json = nlohmann::json::parse(line);
    request.fabric = parse_fabric(json);
    request.device = json.value("device", "");
    request.nearest_samples = json.value("nearest_samples", 0U);
    request.target_error = json.value("target_error", 0.0);
    request.most_samples = json.value("most_samples", 1024U);
    request.most_seconds = json.value("most_seconds", 0.0);
    request.picture = json.value("picture", "");
    request.error_picture = json.value("error_picture", "");
    request.preview = json.value("preview", "");
    request.against = json.value("against", "");
    request.against_error = json.value("against_error", "");
    request.scene = render::parse_scene(json.at("scene").get<std::string>(), "the request's scene",
                                        json.value("folder", "."));
  } catch (const nlohmann::json::exception& error) {
    throw core::Error(core::Code::kInvalidArgument,
                      std::string("not a request: ") + error.what() +
                          "; write one JSON object a line (bench/picture_request.h)");
  }
  render::expand_picture_defaults(request.scene);
  return request;
}

std::shared_ptr<const render::Fabric> FabricCache::take(const FabricChoice& choice) {
  std::shared_ptr<const render::Fabric>& fabric = fabrics_[choice];
  if (fabric) {
    return fabric;
  }
  storage::FabricDatabase database = storage::read_database(choice.path);
  if (choice.sh_order) {
    if (*choice.sh_order > database.sh_order) {
      throw core::Error(core::Code::kInvalidArgument, choice.path + " has order " +
                                                          std::to_string(database.sh_order) +
                                                          "; ask for no higher one");
    }
    database = storage::with_sh_order(std::move(database), *choice.sh_order);
  }
  if (choice.components) {
    if (*choice.components > database.pca_components) {
      throw core::Error(core::Code::kInvalidArgument, choice.path + " has " +
                                                          std::to_string(database.pca_components) +
                                                          " components; ask for no more");
    }
    database = storage::with_components(std::move(database), *choice.components);
  }
  if (choice.half) {
    database = storage::in_half_precision(std::move(database));
  }
  render::PrecomputedSettings settings;
  settings.blend_low = choice.blend_low.value_or(settings.blend_low);
  settings.blend_high = choice.blend_high.value_or(settings.blend_high);
  fabric = render::Fabric::from_database(std::move(database),
                                         render::Fabric::Wanted::kFibresAndTransfer, settings);
  return fabric;
}

}  // namespace weft::bench
