#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "fabric/tile.h"
#include "proto/weft/v1/fabric.pb.h"

namespace weft::cli {

// A plain linear colour for each of the tile's materials: all that it reflects and transmits.
[[nodiscard]] std::vector<glm::vec3> fibre_colours(const v1::FabricDescription& description,
                                                   const fabric::Tile& tile);

}  // namespace weft::cli
