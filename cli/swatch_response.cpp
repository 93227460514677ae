#include "cli/swatch_response.h"

#include <algorithm>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include <glm/geometric.hpp>

#include "render/precomputed_fabric.h"
#include "shading/spherical_harmonics.h"
#include "storage/light_tables.h"

namespace weft::cli {

namespace {

// A channel for each part: Schlick's grazing reflection alone, with all of the rest of the
// reflection, and with all of the transmission.
std::vector<shading::FibreMaterial> probes(std::vector<shading::FibreMaterial> materials) {
  for (shading::FibreMaterial& material : materials) {
    material.c_r = {0, 1, 0};
    material.c_tt = {0, 0, 1};
  }
  return materials;
}

// From the channels of the probes to the parts.
template <class Value>
std::array<Value, 3> parts_of(Value grazing, Value reflecting, Value transmitting) {
  return {grazing, reflecting - grazing, transmitting - grazing};
}

struct Lit {
  glm::vec3 towards{0, 0, 1};
  double irradiance = 0;
};

using Harmonics = std::array<double, shading::kShMaxCount>;

// From light to what arrives: [rows, n] times the first n of the light's harmonics.
template <class Number>
Harmonics arriving(const Number* matrix, std::size_t rows, std::size_t n, const Harmonics& light) {
  Harmonics result{};
  for (std::size_t j1 = 0; j1 < rows; ++j1) {
    for (std::size_t j0 = 0; j0 < n; ++j0) {
      result[j1] += static_cast<double>(matrix[j1 * n + j0]) * light[j0];
    }
  }
  return result;
}

std::vector<Lit> lights_of(const v1::Scene& scene) {
  std::vector<Lit> lights;
  for (const v1::Light& light : scene.lights()) {
    const v1::Vector& towards = light.directional().towards();
    lights.push_back({glm::normalize(glm::vec3(towards.x(), towards.y(), towards.z())),
                      light.directional().irradiance().r()});
  }
  return lights;
}

}  // namespace

// The scene's lights, and the sum of their harmonics.
struct SwatchResponse::Light {
  std::vector<Lit> lights;
  Harmonics harmonics{};
};

// One group's pixels, with the sums of their C_S.
struct SwatchResponse::Seen {
  Group group;
  std::array<Harmonics, kParts> c_s{};
};

SwatchResponse::SwatchResponse(const storage::FabricDatabase& base,
                               const coordinator::LightCarrier& carrier, unsigned threads)
    : yarns_(base.yarn_names.size()) {
  storage::FabricDatabase database = base;
  Light light;
  light.lights = lights_of(measuring_scene(database.size_mm, 1));
  for (const Lit& lit : light.lights) {
    const shading::ShVector y = render::harmonics_of_directional(lit.towards);
    for (std::size_t j = 0; j < light.harmonics.size(); ++j) {
      light.harmonics[j] += lit.irradiance * static_cast<double>(y.c[j]);
    }
  }
  database.materials = probes(std::move(database.materials));
  database.c_s = storage::scattering_tables(database.materials, database.sh_order);
  const SwatchPicture picture = draw_swatch(std::move(database), 1, threads);
  const render::PrecomputedFabric& fabric = *picture.fabric->precomputed();
  picture_pixels_ = static_cast<double>(picture.drawing.layers.segment.size());

  std::map<std::tuple<std::size_t, std::size_t, std::size_t>, Seen> found;
  for (std::size_t i = 0; i < picture.drawing.layers.segment.size(); ++i) {
    const std::uint32_t segment = picture.drawing.layers.segment[i];
    if (segment == render::kNoSegment) {
      continue;
    }
    const std::size_t yarn = picture.yarn_of(segment);
    const std::size_t material = fabric.material_of_segment(segment);
    const std::size_t cell = fabric.database().cell_of_segment[segment];
    Seen& seen = found[{yarn, material, cell}];
    seen.group.yarn = yarn;
    seen.group.material = material;
    seen.group.cell = cell;
    seen.group.pixels += 1;
    const render::ShadingPoint point =
        fabric.point(segment, picture.drawing.layers.tangent[i], {0, 0, 1});
    glm::dvec3 single(0);
    for (const Lit& lit : light.lights) {
      single += lit.irradiance * glm::dvec3(fabric.single_directional(point, lit.towards));
    }
    const auto of_single = parts_of(single.x, single.y, single.z);
    for (std::size_t p = 0; p < kParts; ++p) {
      seen.group.single[p] += of_single[p];
    }
    for (std::size_t j = 0; j < shading::kShMaxCount; ++j) {
      const auto of_c_s =
          parts_of(static_cast<double>(point.c_s[0].c[j]), static_cast<double>(point.c_s[1].c[j]),
                   static_cast<double>(point.c_s[2].c[j]));
      for (std::size_t p = 0; p < kParts; ++p) {
        seen.c_s[p][j] += of_c_s[p];
      }
    }
  }
  for (const auto& [key, seen] : found) {
    take(seen, base, carrier, light);
  }
}

void SwatchResponse::take(const Seen& seen, const storage::FabricDatabase& database,
                          const coordinator::LightCarrier& carrier, const Light& light) {
  const std::size_t n = std::size_t{database.sh_order + 1} * (std::size_t{database.sh_order} + 1);
  const std::size_t low = shading::shape_coefficients(database.sh_order);
  Group group = seen.group;
  const auto received = [&](const Harmonics& harmonics) {
    Parts parts{};
    for (std::size_t p = 0; p < kParts; ++p) {
      for (std::size_t j = 0; j < n; ++j) {
        parts[p] += seen.c_s[p][j] * harmonics[j];
      }
    }
    return parts;
  };
  for (std::size_t c = 0; c < 3; ++c) {
    const float* matrix = &database.transfer[(3 * group.cell + c) * n * n];
    group.of_channels[c] = received(arriving(matrix, n, n, light.harmonics));
  }
  for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
    const std::vector<double> shape = carrier.shape(group.cell, k);
    group.of_shapes[k] = received(arriving(shape.data(), low, n, light.harmonics));
  }
  groups_.push_back(group);
}

std::vector<YarnColour> SwatchResponse::colours(
    const std::vector<shading::FibreMaterial>& materials,
    const coordinator::CarriedSums& sums) const {
  std::vector<YarnColour> colours(yarns_);
  for (const Group& group : groups_) {
    YarnColour& colour = colours[group.yarn];
    colour.share += group.pixels;
    for (int c = 0; c < 3; ++c) {
      const double reflected = materials[group.material].c_r[c];
      const Parts factors{1, reflected,
                          (1 - reflected) * static_cast<double>(materials[group.material].c_tt[c])};
      const std::size_t row = 3 * group.cell + static_cast<std::size_t>(c);
      for (std::size_t p = 0; p < kParts; ++p) {
        double received = group.single[p];
        for (std::size_t old = 0; old < 3; ++old) {
          received += sums.channels[row][old] * group.of_channels[old][p];
        }
        for (std::size_t k = 0; k < shading::kOrderShapes; ++k) {
          received += sums.shapes[row][k] * group.of_shapes[k][p];
        }
        colour.linear[c] += factors[p] * received;
      }
    }
  }
  for (YarnColour& colour : colours) {
    colour.linear /= std::max(1.0, colour.share);
    colour.share /= picture_pixels_;
  }
  return colours;
}

}  // namespace weft::cli
