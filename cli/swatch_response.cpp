#include "cli/swatch_response.h"

#include <algorithm>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include <glm/geometric.hpp>

#include "render/precomputed_fabric.h"
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

SwatchResponse::SwatchResponse(storage::FabricDatabase database, unsigned threads)
    : yarns_(database.yarn_names.size()),
      harmonics_((std::size_t{database.sh_order} + 1) * (std::size_t{database.sh_order} + 1)) {
  const std::vector<Lit> lights = lights_of(measuring_scene(database.size_mm, 1));
  for (const Lit& light : lights) {
    const shading::ShVector y = render::harmonics_of_directional(light.towards);
    for (std::size_t j = 0; j < harmonics_; ++j) {
      c_light_[j] += light.irradiance * static_cast<double>(y.c[j]);
    }
  }
  database.materials = probes(std::move(database.materials));
  database.c_s = storage::scattering_tables(database.materials, database.sh_order);
  const SwatchPicture picture = draw_swatch(std::move(database), 1, threads);
  const render::PrecomputedFabric& fabric = *picture.fabric->precomputed();
  picture_pixels_ = static_cast<double>(picture.drawing.layers.segment.size());

  std::map<std::tuple<std::size_t, std::size_t, std::size_t>, Group> groups;
  for (std::size_t i = 0; i < picture.drawing.layers.segment.size(); ++i) {
    const std::uint32_t segment = picture.drawing.layers.segment[i];
    if (segment == render::kNoSegment) {
      continue;
    }
    const std::size_t yarn = picture.yarn_of(segment);
    const std::size_t material = fabric.material_of_segment(segment);
    const std::size_t cell = fabric.database().cell_of_segment[segment];
    Group& group = groups[{yarn, material, cell}];
    group.yarn = yarn;
    group.material = material;
    group.cell = cell;
    group.pixels += 1;
    const render::ShadingPoint point =
        fabric.point(segment, picture.drawing.layers.tangent[i], {0, 0, 1});
    glm::dvec3 single(0);
    for (const Lit& light : lights) {
      single += light.irradiance * glm::dvec3(fabric.single_directional(point, light.towards));
    }
    const auto of_single = parts_of(single.x, single.y, single.z);
    for (std::size_t p = 0; p < kParts; ++p) {
      group.single[p] += of_single[p];
    }
    for (std::size_t j = 0; j < harmonics_; ++j) {
      const auto of_c_s =
          parts_of(static_cast<double>(point.c_s[0].c[j]), static_cast<double>(point.c_s[1].c[j]),
                   static_cast<double>(point.c_s[2].c[j]));
      for (std::size_t p = 0; p < kParts; ++p) {
        group.c_s[p][j] += of_c_s[p];
      }
    }
  }
  for (auto& [key, group] : groups) {
    groups_.push_back(group);
  }
}

std::vector<YarnColour> SwatchResponse::colours(
    const std::vector<shading::FibreMaterial>& materials,
    const std::vector<float>& transfer) const {
  std::vector<YarnColour> colours(yarns_);
  for (const Group& group : groups_) {
    YarnColour& colour = colours[group.yarn];
    colour.share += group.pixels;
    for (int c = 0; c < 3; ++c) {
      const double reflected = materials[group.material].c_r[c];
      const std::array<double, kParts> factors{
          1, reflected, (1 - reflected) * static_cast<double>(materials[group.material].c_tt[c])};
      const std::size_t channel = 3 * group.cell + static_cast<std::size_t>(c);
      const float* matrix = &transfer[channel * harmonics_ * harmonics_];
      for (std::size_t p = 0; p < kParts; ++p) {
        colour.linear[c] += factors[p] * group.single[p];
      }
      for (std::size_t j1 = 0; j1 < harmonics_; ++j1) {
        double arriving = 0;
        for (std::size_t j0 = 0; j0 < harmonics_; ++j0) {
          arriving += static_cast<double>(matrix[j1 * harmonics_ + j0]) * c_light_[j0];
        }
        for (std::size_t p = 0; p < kParts; ++p) {
          colour.linear[c] += factors[p] * group.c_s[p][j1] * arriving;
        }
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
