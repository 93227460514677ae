#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/transport_tiles.h"
#include "worker/tile_scene.h"

namespace weft::worker {
namespace {

std::string tile_bytes(float radius_mm) {
  fabric::Tile tile = test::empty_tile(1, 1);
  test::add_strand(tile, {{0, 0.5F, 0}, {1, 0.5F, 0}}, radius_mm, 1, 0);
  test::finish(tile);
  return fabric::encode_tile(tile);
}

TEST(TileScene, IsBuiltOnceForAllWhoHoldIt) {
  const std::string bytes = tile_bytes(0.1F);
  const auto first = tile_scene(bytes);
  EXPECT_EQ(tile_scene(bytes), first);
  EXPECT_EQ(tile_scene(std::string(bytes)), first);
  EXPECT_NE(tile_scene(tile_bytes(0.2F)), first);
  std::vector<std::shared_ptr<const TileScene>> seen(8);
  {
    std::vector<std::jthread> threads;
    for (auto& scene : seen) {
      threads.emplace_back([&] { scene = tile_scene(tile_bytes(0.3F)); });
    }
  }
  for (const auto& scene : seen) {
    EXPECT_EQ(scene, seen.front());
  }
}

TEST(TileScene, IsGivenUpWithItsLastHolder) {
  const std::string bytes = tile_bytes(0.1F);
  std::weak_ptr<const TileScene> held = tile_scene(bytes);
  EXPECT_TRUE(held.expired());
  EXPECT_EQ(tile_scene(bytes)->tile.strands.size(), 1U);
}

TEST(TileScene, OfDamagedBytesIsAnErrorEachTime) {
  EXPECT_THROW(static_cast<void>(tile_scene("no tile")), core::Error);
  EXPECT_THROW(static_cast<void>(tile_scene("no tile")), core::Error);
}

}  // namespace
}  // namespace weft::worker
