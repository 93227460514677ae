#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/obj_mesh.h"

namespace weft::render {

// What lies behind a face of a tetrahedron when it is no other tetrahedron.
enum class Outside : std::int32_t { kTop = -1, kBottom = -2, kBorder = -3 };

// A piece of the map between the world and the flat fabric that is affine.
struct Tetrahedron {
  std::array<glm::dvec3, 4> corners_mm;  // in the world
  // Face i is opposite to corner i: its unit normal points out, its plane is normal . x = offset.
  std::array<glm::dvec3, 4> normals;
  std::array<double, 4> offsets_mm;
  // The tetrahedron behind face i, or an Outside.
  std::array<std::int32_t, 4> behind;
  glm::dmat3 to_flat{1};  // flat = to_flat world + shift
  glm::dvec3 shift_mm{0, 0, 0};
  glm::mat3 rotation{1};  // orthogonal polar factor of to_flat
  bool bare = false;      // so thin, in the world or in the texture, that it holds no fibre
};

// A prism of the shell, seen in the flat fabric.
struct ShellTriangle {
  std::array<glm::dvec2, 3> flat_mm;
  std::array<glm::dvec3, 3> top_mm;                // in the world
  std::array<std::int32_t, 3> across{-1, -1, -1};  // the triangle beyond the edge opposite to a
                                                   // corner, where the fabric goes on; -1: nothing
};

struct ShellShape {
  glm::dvec2 texture_mm{0, 0};  // cloth that a unit of texture spans; 0: by area
  double thickness_mm = 0;      // in the world
  double flat_low_mm = 0;       // of the flat fabric
  double flat_high_mm = 0;
  bool flip_normals = false;
};

// A mesh thickened along its vertex normals to a layer of prisms, each cut into three tetrahedra
// (Porumbescu et al. 2005). Tetrahedra 3 k to 3 k + 2 make up triangle k. The cut depends on the
// numbers of the points alone, so that neighbours agree on the diagonals of their common side.
struct ShellGeometry {
  std::vector<Tetrahedron> tetrahedra;
  std::vector<ShellTriangle> triangles;
  std::uint32_t folded = 0;  // tetrahedra turned inside out: the shell is too thick for its bends
  std::uint32_t bare = 0;
};

// Throws core::Error(kInvalidArgument) when the texture of the whole mesh has no area.
[[nodiscard]] ShellGeometry build_shell(const ObjMesh& mesh, const ShellShape& shape);

// The orthogonal matrix nearest to `m` (polar decomposition, Higham 1986): a rotation, or a
// reflection where m mirrors. REQUIRES: m is regular.
[[nodiscard]] glm::dmat3 polar_factor(const glm::dmat3& m);

}  // namespace weft::render
