#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "cli/tile_picture.h"

namespace weft::cli {
namespace {

// One red warp fibre over one blue weft fibre, on a tile of 1 x 1 mm.
fabric::Tile crossing() {
  fabric::Tile tile;
  tile.size_mm = {1, 1};
  tile.z_min_mm = -0.3F;
  tile.z_max_mm = 0.3F;
  tile.material_names = {"red", "blue"};
  tile.yarn_names = {"y"};
  tile.threads = {{0, fabric::Role::kWarp, 0}, {0, fabric::Role::kWeft, 0}};
  tile.strands = {{0, 2, 0, 0, 0.1F, 0, 1}, {2, 2, 1, 1, 0.1F, 1, 0}};
  tile.points_mm = {{0.5F, 0, 0.2F}, {0.5F, 1, 0.2F}, {0, 0.5F, -0.2F}, {1, 0.5F, -0.2F}};
  fabric::index_segments(tile);
  return tile;
}

const std::vector<glm::vec3> kColours = {{1, 0, 0}, {0, 0, 1}};

struct Pixel {
  int r, g, b;
};

// The pixel that shows the cloth at (x, y) millimetres from the picture's middle, seen from above.
Pixel pixel(const std::vector<std::uint8_t>& picture, const PictureView& view, double x, double y) {
  const double per_mm = view.width / view.width_mm;
  const auto column = static_cast<std::size_t>(0.5 * view.width + x * per_mm);
  const auto row = static_cast<std::size_t>(0.5 * view.height - y * per_mm);
  const std::uint8_t* at = picture.data() + 3 * (row * view.width + column);
  return {at[0], at[1], at[2]};
}

TEST(DrawTile, ShowsWhoLiesOnTopAndRepeatsTheTile) {
  const PictureView view{200, 200, 4, 0, 0};
  const std::vector<std::uint8_t> picture = draw_tile(crossing(), kColours, view);
  ASSERT_EQ(picture.size(), 3U * 200 * 200);
  for (const double tile_x : {-1.5, -0.5, 0.5, 1.5}) {
    for (const double tile_y : {-1.5, -0.5, 0.5, 1.5}) {
      const Pixel top = pixel(picture, view, tile_x, tile_y);
      EXPECT_GT(top.r, 2 * top.b);
      const Pixel warp = pixel(picture, view, tile_x, tile_y + 0.4);
      EXPECT_GT(warp.r, 2 * warp.b);
      const Pixel weft = pixel(picture, view, tile_x + 0.4, tile_y);
      EXPECT_GT(weft.b, 2 * weft.r);
      const Pixel hole = pixel(picture, view, tile_x + 0.4, tile_y + 0.4);
      EXPECT_EQ(hole.r, hole.b);
    }
  }
}

TEST(DrawTile, DropsTheShadowOfTheUpperFibreOnTheLower) {
  const PictureView view{400, 400, 2, 0, 0};
  const std::vector<std::uint8_t> picture = draw_tile(crossing(), kColours, view);
  // The light comes from the upper left: right of the warp the weft is dark, left of it lit.
  EXPECT_LT(pixel(picture, view, 0.5 + 0.17, 0.52).b + 40,
            pixel(picture, view, 0.5 - 0.25, 0.52).b);
}

TEST(DrawTile, DrawsTheSamePictureEveryTime) {
  const PictureView view{64, 64, 2, 0.9, 0.5};
  EXPECT_EQ(draw_tile(crossing(), kColours, view), draw_tile(crossing(), kColours, view));
}

TEST(DrawTile, TiltedViewHidesTheHolesBehindTheFibres) {
  const auto holes = [](double tilt) {
    const PictureView view{100, 100, 3, tilt, 0.4};
    const std::vector<std::uint8_t> picture = draw_tile(crossing(), kColours, view);
    int count = 0;
    for (std::size_t p = 0; p < picture.size(); p += 3) {
      count += picture[p] == picture[p + 2] ? 1 : 0;
    }
    return count;
  };
  EXPECT_GT(holes(0), holes(0.9) * 11 / 10);
}

}  // namespace
}  // namespace weft::cli
