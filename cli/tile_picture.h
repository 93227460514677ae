#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "fabric/tile.h"

namespace weft::cli {

// How to draw a piece of endless cloth.
struct PictureView {
  std::uint32_t width = 800;
  std::uint32_t height = 800;
  double width_mm = 2;  // of cloth, across the picture's middle
  double tilt_rad = 0;  // 0 looks straight down on the face; towards pi/2 along the cloth
  double turn_rad = 0;  // of the cloth about its normal
};

// Draws the cloth's fibres as lit cylinders, orthographic, with hard visibility and soft shadows
// of one light. `colours` gives a linear RGB colour for each material of the tile. Returns 8-bit
// sRGB, row-major, top row first. This shows geometry, not appearance: for that, render.
[[nodiscard]] std::vector<std::uint8_t> draw_tile(const fabric::Tile& tile,
                                                  const std::vector<glm::vec3>& colours,
                                                  const PictureView& view);

}  // namespace weft::cli
