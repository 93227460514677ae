#include "render/shell_geometry.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/error.h"

namespace weft::render {
namespace {

// A corner of a prism: which of the triangle's corners, sorted by point number, and which level.
struct PrismCorner {
  std::size_t corner;
  bool top;
};

// The three tetrahedra of a prism over the corners a, b, c, sorted by point number. The diagonal of
// each side runs from the lower end of the smaller point to the upper end of the larger one.
constexpr std::array<std::array<PrismCorner, 4>, 3> kCut = {{
    {{{0, false}, {1, false}, {2, false}, {2, true}}},
    {{{0, false}, {1, false}, {1, true}, {2, true}}},
    {{{0, false}, {0, true}, {1, true}, {2, true}}},
}};

// What lies behind face i (opposite to corner i) of each of them: a tetrahedron of the same prism,
// top, bottom, or half of a side, which is named by the corner that it lacks.
struct Behind {
  enum Kind { kSibling, kTop, kBottom, kLowerSide, kUpperSide } kind;
  std::size_t which;  // sibling, or the side's missing corner
};
constexpr std::array<std::array<Behind, 4>, 3> kBehind = {{
    {{{Behind::kLowerSide, 0},
      {Behind::kLowerSide, 1},
      {Behind::kSibling, 1},
      {Behind::kBottom, 0}}},
    {{{Behind::kUpperSide, 0},
      {Behind::kSibling, 2},
      {Behind::kSibling, 0},
      {Behind::kLowerSide, 2}}},
    {{{Behind::kTop, 0}, {Behind::kSibling, 1}, {Behind::kUpperSide, 1}, {Behind::kUpperSide, 2}}},
}};

using Edge = std::pair<std::uint32_t, std::uint32_t>;  // smaller point first

struct EdgeUse {
  std::uint32_t triangle;
  std::size_t missing;  // corner, in sorted order, that the edge lacks
};

// A triangle whose corners are sorted by point number.
ObjMesh::Triangle sorted(const ObjMesh::Triangle& triangle) {
  std::array<std::size_t, 3> order{0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return triangle.points[a] < triangle.points[b]; });
  ObjMesh::Triangle result{};
  for (std::size_t i = 0; i < 3; ++i) {
    result.points[i] = triangle.points[order[i]];
    result.texture[i] = triangle.texture[order[i]];
  }
  return result;
}

Edge edge_without(const ObjMesh::Triangle& triangle, std::size_t corner) {
  return {triangle.points[corner == 0 ? 1 : 0], triangle.points[corner == 2 ? 1 : 2]};
}

// Unit normals at the points: the mean of the triangles around, weighted by area.
std::vector<glm::dvec3> normals_of(const ObjMesh& mesh, bool flip) {
  std::vector<glm::dvec3> normals(mesh.points.size(), glm::dvec3(0));
  for (const ObjMesh::Triangle& triangle : mesh.triangles) {
    const glm::dvec3& a = mesh.points[triangle.points[0]];
    const glm::dvec3 cross =
        glm::cross(mesh.points[triangle.points[1]] - a, mesh.points[triangle.points[2]] - a);
    for (const std::uint32_t point : triangle.points) {
      normals[point] += flip ? -cross : cross;
    }
  }
  for (glm::dvec3& normal : normals) {
    const double length = glm::length(normal);
    normal = length > 0 ? normal / length : glm::dvec3(0, 0, 1);
  }
  return normals;
}

double texture_area(const ObjMesh::Triangle& triangle) {
  const glm::dvec2 a = triangle.texture[1] - triangle.texture[0];
  const glm::dvec2 b = triangle.texture[2] - triangle.texture[0];
  return 0.5 * std::fabs(a.x * b.y - a.y * b.x);
}

// Millimetres of cloth per unit of texture.
glm::dvec2 texture_scale(const ObjMesh& mesh, const ShellShape& shape) {
  double world = 0;
  double texture = 0;
  for (const ObjMesh::Triangle& triangle : mesh.triangles) {
    const glm::dvec3& a = mesh.points[triangle.points[0]];
    world += 0.5 * glm::length(glm::cross(mesh.points[triangle.points[1]] - a,
                                          mesh.points[triangle.points[2]] - a));
    texture += texture_area(triangle);
  }
  if (!(texture > 0)) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the mesh's texture coordinates span no area; unwrap the mesh anew");
  }
  const double by_area = std::sqrt(world / texture);
  return {shape.texture_mm.x > 0 ? shape.texture_mm.x : by_area,
          shape.texture_mm.y > 0 ? shape.texture_mm.y : by_area};
}

void set_faces(Tetrahedron& tetrahedron) {
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3& a = tetrahedron.corners_mm[(i + 1) % 4];
    const glm::dvec3& b = tetrahedron.corners_mm[(i + 2) % 4];
    const glm::dvec3& c = tetrahedron.corners_mm[(i + 3) % 4];
    glm::dvec3 normal = glm::cross(b - a, c - a);
    const double length = glm::length(normal);
    normal = length > 0 ? normal / length : glm::dvec3(0);
    if (glm::dot(normal, tetrahedron.corners_mm[i] - a) > 0) {
      normal = -normal;
    }
    tetrahedron.normals[i] = normal;
    tetrahedron.offsets_mm[i] = glm::dot(normal, a);
  }
}

// The affine map that takes the corners to their places in the flat fabric.
void set_map(Tetrahedron& tetrahedron, const std::array<glm::dvec3, 4>& flat_mm) {
  const auto edges = [](const std::array<glm::dvec3, 4>& p) {
    return glm::dmat3(p[1] - p[0], p[2] - p[0], p[3] - p[0]);
  };
  // Relative to their size, so that neither unit nor mesh matters.
  const auto flatness = [](const glm::dmat3& m) {
    const double size = glm::length(m[0]) * glm::length(m[1]) * glm::length(m[2]);
    return size > 0 ? std::fabs(glm::determinant(m)) / size : 0;
  };
  constexpr double kThinnest = 1e-9;
  const glm::dmat3 world = edges(tetrahedron.corners_mm);
  const glm::dmat3 flat = edges(flat_mm);
  if (!(flatness(world) > kThinnest) || !(flatness(flat) > kThinnest)) {
    tetrahedron.bare = true;
    return;
  }
  tetrahedron.to_flat = flat * glm::inverse(world);
  tetrahedron.shift_mm = flat_mm[0] - tetrahedron.to_flat * tetrahedron.corners_mm[0];
  tetrahedron.rotation = glm::mat3(polar_factor(tetrahedron.to_flat));
}

// Builds the prisms one by one, then joins them.
class Builder {
 public:
  Builder(const ObjMesh& mesh, const ShellShape& shape)
      : mesh_(mesh),
        shape_(shape),
        normals_(normals_of(mesh, shape.flip_normals)),
        scale_mm_(texture_scale(mesh, shape)) {}

  ShellGeometry build() {
    for (const ObjMesh::Triangle& triangle : mesh_.triangles) {
      sorted_.push_back(sorted(triangle));
      add_prism(triangle, sorted_.back());
    }
    join();
    return std::move(shell_);
  }

 private:
  [[nodiscard]] glm::dvec3 world_of(std::uint32_t point, bool top) const {
    const double offset = (top ? 0.5 : -0.5) * shape_.thickness_mm;
    return mesh_.points[point] + offset * normals_[point];
  }

  void add_prism(const ObjMesh::Triangle& given, const ObjMesh::Triangle& triangle) {
    const auto index = static_cast<std::uint32_t>(shell_.triangles.size());
    ShellTriangle flat_triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      flat_triangle.flat_mm[i] = triangle.texture[i] * scale_mm_;
      flat_triangle.top_mm[i] = world_of(triangle.points[i], true);
      edges_[edge_without(triangle, i)].push_back({index, i});
    }
    shell_.triangles.push_back(flat_triangle);
    const glm::dvec3& a = mesh_.points[given.points[0]];
    glm::dvec3 up =
        glm::cross(mesh_.points[given.points[1]] - a, mesh_.points[given.points[2]] - a);
    up = shape_.flip_normals ? -up : up;
    for (std::size_t k = 0; k < 3; ++k) {
      Tetrahedron tetrahedron;
      std::array<glm::dvec3, 4> flat{};
      for (std::size_t i = 0; i < 4; ++i) {
        const PrismCorner& corner = kCut[k][i];
        tetrahedron.corners_mm[i] = world_of(triangle.points[corner.corner], corner.top);
        flat[i] = glm::dvec3(flat_triangle.flat_mm[corner.corner],
                             corner.top ? shape_.flat_high_mm : shape_.flat_low_mm);
        tetrahedron.behind[i] = behind(index, kBehind[k][i]);
      }
      set_faces(tetrahedron);
      set_map(tetrahedron, flat);
      shell_.bare += tetrahedron.bare ? 1 : 0;
      shell_.folded += is_folded(tetrahedron, k, triangle, up) ? 1 : 0;
      shell_.tetrahedra.push_back(tetrahedron);
    }
  }

  // Whether the tetrahedron's volume has another sign than it has when the normals are those of
  // its own triangle.
  [[nodiscard]] bool is_folded(const Tetrahedron& tetrahedron, std::size_t k,
                               const ObjMesh::Triangle& triangle, const glm::dvec3& up) const {
    std::array<glm::dvec3, 4> straight{};
    for (std::size_t i = 0; i < 4; ++i) {
      const PrismCorner& corner = kCut[k][i];
      straight[i] = mesh_.points[triangle.points[corner.corner]] +
                    (corner.top ? 0.5 : -0.5) * shape_.thickness_mm * glm::normalize(up);
    }
    const auto volume = [](const std::array<glm::dvec3, 4>& p) {
      return glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]);
    };
    return volume(straight) * volume(tetrahedron.corners_mm) < 0;
  }

  static std::int32_t behind(std::uint32_t triangle, const Behind& behind) {
    switch (behind.kind) {
      case Behind::kSibling:
        return static_cast<std::int32_t>(std::size_t{3} * triangle + behind.which);
      case Behind::kTop:
        return static_cast<std::int32_t>(Outside::kTop);
      case Behind::kBottom:
        return static_cast<std::int32_t>(Outside::kBottom);
      default:  // until it is joined
        return static_cast<std::int32_t>(Outside::kBorder);
    }
  }

  // Joins the sides of prisms that share an edge. Where more than two do, all end there.
  void join() {
    for (const auto& [edge, uses] : edges_) {
      if (uses.size() != 2) {
        continue;
      }
      for (std::size_t u = 0; u < 2; ++u) {
        const EdgeUse& here = uses[u];
        const EdgeUse& there = uses[1 - u];
        for (const Behind::Kind half : {Behind::kLowerSide, Behind::kUpperSide}) {
          const auto [tetrahedron, face] = side(here, half);
          shell_.tetrahedra[tetrahedron].behind[face] =
              static_cast<std::int32_t>(side(there, half).first);
        }
        if (fabric_goes_on(here, there)) {
          shell_.triangles[here.triangle].across[here.missing] =
              static_cast<std::int32_t>(there.triangle);
        }
      }
    }
  }

  static std::pair<std::size_t, std::size_t> side(const EdgeUse& use, Behind::Kind half) {
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t face = 0; face < 4; ++face) {
        if (kBehind[k][face].kind == half && kBehind[k][face].which == use.missing) {
          return {std::size_t{3} * use.triangle + k, face};
        }
      }
    }
    return {0, 0};  // not reached: every side has a lower and an upper half
  }

  // Whether both triangles have the same texture along their common edge: no seam.
  [[nodiscard]] bool fabric_goes_on(const EdgeUse& here, const EdgeUse& there) const {
    const auto ends = [&](const EdgeUse& use) {
      const ObjMesh::Triangle& triangle = sorted_[use.triangle];
      return std::pair{triangle.texture[use.missing == 0 ? 1 : 0],
                       triangle.texture[use.missing == 2 ? 1 : 2]};
    };
    return ends(here) == ends(there);
  }

  const ObjMesh& mesh_;
  const ShellShape& shape_;
  std::vector<glm::dvec3> normals_;
  glm::dvec2 scale_mm_;
  std::vector<ObjMesh::Triangle> sorted_;
  std::map<Edge, std::vector<EdgeUse>> edges_;
  ShellGeometry shell_;
};

}  // namespace

glm::dmat3 polar_factor(const glm::dmat3& m) {
  glm::dmat3 x = m;
  for (int i = 0; i < 100; ++i) {
    const glm::dmat3 next = 0.5 * (x + glm::transpose(glm::inverse(x)));
    double change = 0;
    for (int column = 0; column < 3; ++column) {
      change = std::fmax(change, glm::length(next[column] - x[column]));
    }
    x = next;
    if (change < 1e-14) {
      break;
    }
  }
  return x;
}

ShellGeometry build_shell(const ObjMesh& mesh, const ShellShape& shape) {
  return Builder(mesh, shape).build();
}

}  // namespace weft::render
