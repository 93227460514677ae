#include "render/files/obj_parser.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <glm/geometric.hpp>
#include <tiny_obj_loader.h>

#include "core/error.h"

namespace weft::render {
namespace {

static_assert(sizeof(glm::dvec3) == 24 && sizeof(ObjMesh::Triangle) == 64,
              "meshes are handed over as they lie in memory");

[[noreturn]] void refuse(const std::string& name, const std::string& what,
                         core::Code code = core::Code::kInvalidArgument) {
  throw core::Error(code, name + ": " + what);
}

void take_points(const tinyobj::attrib_t& attributes, const std::string& name, ObjMesh& mesh) {
  if (attributes.vertices.size() / 3 > kPointLimit) {
    refuse(name, "more than " + std::to_string(kPointLimit) + " points; use a coarser mesh",
           core::Code::kResourceExhausted);
  }
  for (std::size_t i = 0; i + 2 < attributes.vertices.size(); i += 3) {
    const glm::dvec3 point(attributes.vertices[i], attributes.vertices[i + 1],
                           attributes.vertices[i + 2]);
    if (!is_usable(point)) {
      refuse(name, "point " + std::to_string(i / 3 + 1) +
                       " is not finite or farther than 1e9 from the origin; mend the mesh");
    }
    mesh.points.push_back(point);
  }
}

ObjMesh::Triangle triangle_of(const tinyobj::attrib_t& attributes, const tinyobj::mesh_t& shape,
                              std::size_t face, const std::string& name) {
  ObjMesh::Triangle triangle{};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const tinyobj::index_t index = shape.indices[3 * face + corner];
    const auto point = static_cast<std::size_t>(index.vertex_index);
    const auto texture = static_cast<std::size_t>(index.texcoord_index);
    if (index.vertex_index < 0 || 3 * point + 2 >= attributes.vertices.size()) {
      refuse(name, "a face names a point that is missing; mend the mesh");
    }
    if (index.texcoord_index < 0 || 2 * texture + 1 >= attributes.texcoords.size()) {
      refuse(name,
             "a face has no texture coordinates, which say how the cloth lies; unwrap the mesh and "
             "export it with vt lines");
    }
    triangle.points[corner] = static_cast<std::uint32_t>(point);
    triangle.texture[corner] = {attributes.texcoords[2 * texture],
                                attributes.texcoords[2 * texture + 1]};
    if (!is_usable(triangle.texture[corner])) {
      refuse(name, "a texture coordinate is not finite or beyond 1e9; mend the mesh");
    }
  }
  return triangle;
}

template <class Item>
std::vector<Item> items_from(std::span<const std::byte> bytes, std::size_t limit) {
  if (bytes.size() % sizeof(Item) != 0 || bytes.size() / sizeof(Item) > limit) {
    throw core::Error(core::Code::kDataLoss, "the mesh did not come back whole");
  }
  std::vector<Item> items(bytes.size() / sizeof(Item));
  if (!items.empty()) {
    std::memcpy(items.data(), bytes.data(), bytes.size());
  }
  return items;
}

}  // namespace

bool is_usable(double value) { return std::fabs(value) <= kCoordinateLimit; }
bool is_usable(const glm::dvec3& point) {
  return is_usable(point.x) && is_usable(point.y) && is_usable(point.z);
}
bool is_usable(const glm::dvec2& place) { return is_usable(place.x) && is_usable(place.y); }

void hand_over(const ObjMesh& mesh, core::FlatWriter& answer) {
  answer.bytes(std::as_bytes(std::span(mesh.points)));
  answer.bytes(std::as_bytes(std::span(mesh.triangles)));
}

ObjMesh parse_obj(const std::string& text, const std::string& name) {
  tinyobj::ObjReader reader;
  tinyobj::ObjReaderConfig config;
  config.triangulate = true;
  config.vertex_color = false;
  const bool read = reader.ParseFromString(text, "", config);
  if (!read) {
    refuse(name, "not an OBJ file that can be read: " + reader.Error());
  }
  ObjMesh mesh;
  take_points(reader.GetAttrib(), name, mesh);
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    const std::size_t faces = shape.mesh.indices.size() / 3;
    if (mesh.triangles.size() + faces > kTriangleLimit) {
      refuse(name, "more than " + std::to_string(kTriangleLimit) + " triangles; use a coarser mesh",
             core::Code::kResourceExhausted);
    }
    for (std::size_t face = 0; face < faces; ++face) {
      const ObjMesh::Triangle triangle = triangle_of(reader.GetAttrib(), shape.mesh, face, name);
      const glm::dvec3& a = mesh.points[triangle.points[0]];
      const glm::dvec3 cross =
          glm::cross(mesh.points[triangle.points[1]] - a, mesh.points[triangle.points[2]] - a);
      if (glm::dot(cross, cross) > 0) {
        mesh.triangles.push_back(triangle);
      }
    }
  }
  if (mesh.triangles.empty()) {
    refuse(name, "no triangles; give a mesh with faces");
  }
  return mesh;
}

core::SandboxHandler obj_handler() {
  return {[] {},
          [](std::span<const std::byte> file, const std::vector<std::string>& arguments,
             core::FlatWriter& answer) {
            const std::string text(reinterpret_cast<const char*>(file.data()), file.size());
            hand_over(parse_obj(text, arguments.at(0)), answer);
          }};
}

ObjMesh mesh_from(core::FlatReader answer) {
  ObjMesh mesh;
  mesh.points = items_from<glm::dvec3>(answer.bytes(), kPointLimit);
  mesh.triangles = items_from<ObjMesh::Triangle>(answer.bytes(), kTriangleLimit);
  answer.end();
  const auto is_right = [&mesh](const ObjMesh::Triangle& triangle) {
    return std::all_of(triangle.points.begin(), triangle.points.end(),
                       [&mesh](std::uint32_t point) { return point < mesh.points.size(); }) &&
           std::all_of(triangle.texture.begin(), triangle.texture.end(),
                       [](const glm::dvec2& place) { return is_usable(place); });
  };
  if (!std::all_of(mesh.points.begin(), mesh.points.end(),
                   [](const glm::dvec3& point) { return is_usable(point); }) ||
      !std::all_of(mesh.triangles.begin(), mesh.triangles.end(), is_right)) {
    throw core::Error(core::Code::kDataLoss, "the mesh did not come back whole");
  }
  return mesh;
}

}  // namespace weft::render
