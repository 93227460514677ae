#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/fabric.h"
#include "render/obj_mesh.h"
#include "render/shell_cloth.h"
#include "tests/transport_tiles.h"

// Fabrics and meshes built by hand for tests.
namespace weft::test {

// A sheet of n x n squares over [-half, half]^2, its texture coordinates the millimetres of the
// sheet; `place` puts its points into the world.
template <class Place>
render::ObjMesh sheet(int n, double half, const Place& place) {
  render::ObjMesh mesh;
  const auto at = [&](int i) { return half * (2.0 * i / n - 1); };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      mesh.points.push_back(place(glm::dvec2(at(x), at(y))));
    }
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const auto point = [&](int i, int j) {
        return static_cast<std::uint32_t>((y + j) * (n + 1) + x + i);
      };
      const auto texture = [&](int i, int j) { return glm::dvec2(at(x + i), at(y + j)); };
      mesh.triangles.push_back(
          {{point(0, 0), point(1, 0), point(1, 1)}, {texture(0, 0), texture(1, 0), texture(1, 1)}});
      mesh.triangles.push_back(
          {{point(0, 0), point(1, 1), point(0, 1)}, {texture(0, 0), texture(1, 1), texture(0, 1)}});
    }
  }
  return mesh;
}

// Folds that hang over one another, as a curtain's do.
inline glm::dvec3 in_folds(glm::dvec2 p) {
  return {p.x - 0.45 * std::sin(2 * p.x), p.y, 0.8 * std::sin(2.0 * p.x) + 0.2 * std::cos(p.y)};
}

inline std::shared_ptr<const render::Fabric> fabric_of(fabric::Tile tile) {
  const float middle = 0.5f * (tile.z_min_mm + tile.z_max_mm);
  for (glm::vec3& point : tile.points_mm) {
    point.z -= middle;
  }
  finish(tile);
  std::vector<shading::FibreBcsdf> bcsdfs(tile.material_names.size(),
                                          shading::FibreBcsdf(shading::FibreMaterial{}));
  return std::make_shared<render::Fabric>(std::move(tile), std::move(bcsdfs));
}

inline std::unique_ptr<render::Cloth> shell_of(std::shared_ptr<const render::Fabric> fabric,
                                               const render::ObjMesh& mesh,
                                               bool black_underlay = false) {
  render::ShellPlacement placement;
  placement.texture_mm = {1, 1};
  placement.black_underlay = black_underlay;
  std::vector<std::string> remarks;
  return render::make_shell_cloth(std::move(fabric), mesh, placement, remarks);
}

// Two fabrics whose fibres lie at other places, in a pattern of 3 x 2 blocks.
inline render::ClothFabric damask() {
  std::vector<std::shared_ptr<const render::Fabric>> fabrics;
  for (const std::uint64_t seed : {1, 2}) {
    fabric::Tile tile = crossed_layers(4, 6, 0.04f, 6, seed);
    tile.blocks = {2, 1};
    fabrics.push_back(fabric_of(std::move(tile)));
  }
  render::BlockPattern pattern;
  pattern.width = 3;
  pattern.height = 2;
  pattern.fabric = {0, 1, 1, 1, 0, 0};
  return {std::move(fabrics), std::move(pattern)};
}

}  // namespace weft::test
