#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "proto/weft/v1/scene.pb.h"
#include "render/draw.h"
#include "render/fabric.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// The scene in which a cloth's colour is measured, after the geometry 45:0 of colorimetry: one tile
// of endless flat cloth over black, seen from straight above without perspective, lit by four
// parallel lights 45 degrees from the normal, diagonally to warp and weft. Its light is white
// (D65), and so strong that a perfect white diffuser shows `exposure` in every channel.
[[nodiscard]] v1::Scene measuring_scene(glm::vec2 tile_size_mm, double exposure);

// A database drawn in the measuring scene, one sample a pixel, with its segments and tangents.
struct SwatchPicture {
  std::shared_ptr<const render::Fabric> fabric;
  render::Drawing drawing;
  // The index of the yarn that a segment belongs to.
  [[nodiscard]] std::size_t yarn_of(std::uint32_t segment) const;
};
[[nodiscard]] SwatchPicture draw_swatch(storage::FabricDatabase database, double exposure,
                                        unsigned threads);

// What is seen of one yarn in the measuring scene.
struct YarnColour {
  glm::dvec3 linear{0, 0, 0};  // mean radiance
  double share = 0;            // of the picture; 0: it is not seen
};

// The mean colours of the database's yarns in the measuring scene, drawn from the database.
[[nodiscard]] std::vector<YarnColour> yarn_colours(storage::FabricDatabase database,
                                                   double exposure, unsigned threads);

}  // namespace weft::cli
