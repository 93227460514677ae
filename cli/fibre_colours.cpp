#include "cli/fibre_colours.h"

#include <glm/common.hpp>

namespace weft::cli {

std::vector<glm::vec3> fibre_colours(const v1::FabricDescription& description,
                                     const fabric::Tile& tile) {
  std::vector<glm::vec3> colours(tile.material_names.size(), glm::vec3(0.6F));
  for (std::size_t m = 0; m < colours.size(); ++m) {
    for (const v1::Material& material : description.materials()) {
      if (material.name() == tile.material_names[m]) {
        const glm::dvec3 albedo{material.c_r().r() + material.c_tt().r(),
                                material.c_r().g() + material.c_tt().g(),
                                material.c_r().b() + material.c_tt().b()};
        colours[m] = glm::vec3(glm::min(albedo, glm::dvec3(1)));
      }
    }
  }
  return colours;
}

}  // namespace weft::cli
