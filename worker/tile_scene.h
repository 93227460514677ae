#pragma once

#include <memory>
#include <string_view>

#include "fabric/tile.h"
#include "transport/scene.h"

namespace weft::worker {

// The tile that most stages read, and its rays.
struct TileScene {
  explicit TileScene(std::string_view bytes);
  fabric::Tile tile;
  transport::Scene scene;
};

// The scene of these bytes; one that another baker of this process still holds is shared, so that a
// fabric's stages build it once. Any thread; others wait while a scene of the same bytes is built.
[[nodiscard]] std::shared_ptr<const TileScene> tile_scene(std::string_view bytes);

}  // namespace weft::worker
