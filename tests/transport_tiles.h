#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/random.h"
#include "fabric/tile.h"

// Small tiles built by hand for the tests of transport/ and worker/.
namespace weft::test {

inline fabric::Tile empty_tile(float size_x_mm, float size_y_mm) {
  fabric::Tile tile;
  tile.size_mm = {size_x_mm, size_y_mm};
  tile.material_names = {"grey"};
  tile.yarn_names = {"yarn"};
  tile.threads = {{0, fabric::Role::kExplicit, 0}};
  return tile;
}

// Call when all strands are there.
inline void finish(fabric::Tile& tile) {
  tile.z_min_mm = 1e30f;
  tile.z_max_mm = -1e30f;
  for (const fabric::Strand& strand : tile.strands) {
    for (std::uint32_t i = 0; i < strand.point_count; ++i) {
      const float z = tile.points_mm[strand.first_point + i].z;
      tile.z_min_mm = std::fmin(tile.z_min_mm, z - strand.radius_mm);
      tile.z_max_mm = std::fmax(tile.z_max_mm, z + strand.radius_mm);
    }
  }
  fabric::index_segments(tile);
}

inline void add_strand(fabric::Tile& tile, const std::vector<glm::vec3>& points, float radius_mm,
                       int period_x, int period_y) {
  tile.strands.push_back({static_cast<std::uint32_t>(tile.points_mm.size()),
                          static_cast<std::uint32_t>(points.size()), 0, 0, radius_mm, period_x,
                          period_y});
  tile.points_mm.insert(tile.points_mm.end(), points.begin(), points.end());
}

// Layers of parallel cylinders, alternately along x and y, `per_layer` of them over a unit tile
// (maths of the transfer matrix's numerical checks).
inline fabric::Tile crossed_layers(int layers, int per_layer, float radius_mm, int segments,
                                   std::uint64_t seed = 1) {
  fabric::Tile tile = empty_tile(1, 1);
  core::Random random(seed, 0);
  for (int layer = 0; layer < layers; ++layer) {
    const float z = (static_cast<float>(layer) + 0.5f) * 2.2f * radius_mm;
    const float shift = random.uniform();
    for (int i = 0; i < per_layer; ++i) {
      const float across = (static_cast<float>(i) + shift) / static_cast<float>(per_layer);
      std::vector<glm::vec3> points;
      for (int p = 0; p <= segments; ++p) {
        const float along = static_cast<float>(p) / static_cast<float>(segments);
        points.push_back(layer % 2 == 0 ? glm::vec3{along, across, z}
                                        : glm::vec3{across, along, z});
      }
      add_strand(tile, points, radius_mm, layer % 2 == 0 ? 1 : 0, layer % 2 == 0 ? 0 : 1);
    }
  }
  finish(tile);
  return tile;
}

// Short open hairs in any direction, some of which leave the tile's box.
inline fabric::Tile random_hairs(int count, float size_x_mm, float size_y_mm, float thickness_mm,
                                 std::uint64_t seed) {
  fabric::Tile tile = empty_tile(size_x_mm, size_y_mm);
  for (int i = 0; i < count; ++i) {
    core::Random random(seed, static_cast<std::uint32_t>(i));
    glm::vec3 at{3 * (random.uniform() - 0.5f) * size_x_mm,
                 3 * (random.uniform() - 0.5f) * size_y_mm, thickness_mm * random.uniform()};
    std::vector<glm::vec3> points{at};
    for (int p = 0; p < 3; ++p) {
      at += 0.1f *
            glm::vec3{random.uniform() - 0.5f, random.uniform() - 0.5f, random.uniform() - 0.5f};
      points.push_back(at);
    }
    add_strand(tile, points, 0.005f + 0.01f * random.uniform(), 0, 0);
  }
  finish(tile);
  return tile;
}

inline glm::vec3 random_direction(core::Random& random) {
  const float z = 1 - 2 * random.uniform();
  const float phi = 2 * std::numbers::pi_v<float> * random.uniform();
  const float r = std::sqrt(std::fmax(0.0f, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace weft::test
