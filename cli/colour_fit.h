#pragma once

#include <functional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "shading/fibre_material.h"

namespace weft::cli {

// One or several yarns that shall show one colour, and all the materials they are of.
struct ColourTarget {
  std::string label;                   // for people: "warp"
  std::vector<std::size_t> materials;  // indices; no two targets share one
  glm::dvec3 linear{0, 0, 0};
};

// A dye of a fibre: C_R and C_TT are these times its strength, for each channel a number from 0 to
// 1. The larger of both is 1; their ratio is that of the sums of the material's channels, so that a
// fibre is as shiny in its new colour as in its old one.
struct Dye {
  double reflect = 0;
  double transmit = 1;
};
[[nodiscard]] Dye dye_of(const shading::FibreMaterial& material);
// Rounded to five digits behind the point, as descriptions hold them.
[[nodiscard]] shading::FibreMaterial dyed(const shading::FibreMaterial& material, const Dye& dye,
                                          glm::dvec3 strength);

// The colours that the targets show with these materials.
using MeasureColours =
    std::function<std::vector<glm::dvec3>(const std::vector<shading::FibreMaterial>&)>;

struct ColourFit {
  std::vector<shading::FibreMaterial> materials;
  std::vector<glm::dvec3> reached;  // by target
  std::vector<double> delta_e;      // CIEDE2000 to what was asked for
  int pictures = 0;                 // that were measured
  [[nodiscard]] double worst_delta_e() const;
};

// Finds the dyes with which the targets show their colours: secants in the logarithm of what is
// shown over the logit of the strength, for each target and channel by itself, all of them measured
// together, because light goes from yarn to yarn. Colours that cannot be reached come out as near
// as was found. The same input gives the same output.
[[nodiscard]] ColourFit fit_colours(const std::vector<ColourTarget>& targets,
                                    const std::vector<shading::FibreMaterial>& materials,
                                    const MeasureColours& measure);

}  // namespace weft::cli
