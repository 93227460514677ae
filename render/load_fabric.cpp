#include "render/load_fabric.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "fabric/build.h"
#include "fabric/description.h"
#include "render/sphere_sampling.h"
#include "storage/fabric_database.h"

namespace weft::render {
namespace {

glm::vec3 colour_of(const v1::Rgb& rgb) { return glm::dvec3(rgb.r(), rgb.g(), rgb.b()); }

shading::FibreMaterial material_of(const v1::Material& material) {
  constexpr double kRadians = kPi / 180;
  shading::FibreMaterial result;
  result.c_r = colour_of(material.c_r());
  result.c_tt = colour_of(material.c_tt());
  result.beta_r = static_cast<float>(material.beta_r_deg() * kRadians);
  result.beta_tt = static_cast<float>(material.beta_tt_deg() * kRadians);
  result.gamma_tt = static_cast<float>(material.gamma_tt_deg() * kRadians);
  return result;
}

std::string name_in(const std::string& description_json) {
  const auto json = nlohmann::json::parse(description_json, nullptr, false);
  const bool has_name = json.is_object() && json.contains("name") && json["name"].is_string();
  return has_name ? json["name"].get<std::string>() : std::string();
}

}  // namespace

bool is_description(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".textproto" || extension == ".txtpb" || extension == ".json";
}

std::unique_ptr<Fabric> build_fabric(const v1::FabricDescription& description) {
  fabric::Tile tile = fabric::build_tile(description);
  std::vector<shading::FibreBcsdf> bcsdfs;
  for (const std::string& name : tile.material_names) {
    const auto found =
        std::find_if(description.materials().begin(), description.materials().end(),
                     [&](const v1::Material& material) { return material.name() == name; });
    if (found == description.materials().end()) {
      throw core::Error(core::Code::kInvalidArgument,
                        "the fibres are of material " + name + ", which the description lacks");
    }
    bcsdfs.emplace_back(material_of(*found));
  }
  return std::make_unique<Fabric>(std::move(tile), std::move(bcsdfs));
}

LoadedFabric load_fabric(const std::filesystem::path& path, Fabric::Wanted wanted) {
  LoadedFabric loaded;
  if (is_description(path)) {
    if (wanted == Fabric::Wanted::kFibresAndTransfer) {
      throw core::Error(core::Code::kInvalidArgument,
                        path.string() +
                            ": a description has nothing precomputed; make a database of it with "
                            "weft run, or draw it with --integrator path");
    }
    const v1::FabricDescription description = fabric::load_description(path);
    loaded.name = description.name();
    loaded.fabric = build_fabric(description);
    return loaded;
  }
  storage::FabricDatabase database = storage::read_database(path);
  loaded.name = name_in(database.description_json);
  loaded.content_digest = storage::content_digest(path).hex();
  loaded.fabric = Fabric::from_database(std::move(database), wanted);
  return loaded;
}

}  // namespace weft::render
