#include "coordinator/versions/fibre_materials.h"

#include <numbers>

namespace weft::coordinator {

shading::FibreMaterial fibre_material(const v1::Material& material) {
  const auto colour = [](const v1::Rgb& rgb) { return glm::vec3(rgb.r(), rgb.g(), rgb.b()); };
  const auto radians = [](double degrees) {
    return static_cast<float>(degrees * std::numbers::pi / 180);
  };
  return {colour(material.c_r()), colour(material.c_tt()), radians(material.beta_r_deg()),
          radians(material.beta_tt_deg()), radians(material.gamma_tt_deg())};
}

}  // namespace weft::coordinator
