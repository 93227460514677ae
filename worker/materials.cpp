#include "worker/materials.h"

#include <numbers>

#include "worker/bakers.h"

namespace weft::worker {

namespace {

shading::FibreMaterial fibre_material(const v1::Material& material, const char* kind) {
  const auto colour = [kind](const v1::Rgb& rgb) {
    require(rgb.r() >= 0 && rgb.r() <= 1 && rgb.g() >= 0 && rgb.g() <= 1 && rgb.b() >= 0 &&
                rgb.b() <= 1,
            kind, "a material's colours must be between 0 and 1");
    return glm::vec3(rgb.r(), rgb.g(), rgb.b());
  };
  const auto width = [kind](double degrees) {
    require(degrees >= 0.1 && degrees <= 180, kind,
            "a material's widths must be between 0.1 and 180 degrees");
    return static_cast<float>(degrees * std::numbers::pi / 180);
  };
  return {colour(material.c_r()), colour(material.c_tt()), width(material.beta_r_deg()),
          width(material.beta_tt_deg()), width(material.gamma_tt_deg())};
}

}  // namespace

std::vector<shading::FibreBcsdf> bcsdfs_of(
    const google::protobuf::RepeatedPtrField<v1::Material>& materials, const fabric::Tile& tile,
    const char* kind) {
  require(static_cast<std::size_t>(materials.size()) == tile.material_names.size(), kind,
          "there must be one material for each of the tile's");
  std::vector<shading::FibreBcsdf> bcsdfs;
  for (const v1::Material& material : materials) {
    bcsdfs.emplace_back(fibre_material(material, kind));
  }
  return bcsdfs;
}

}  // namespace weft::worker
