#include "render/obj_mesh.h"

#include <cmath>
#include <string>

#include <glm/geometric.hpp>
#include <tiny_obj_loader.h>

#include "core/error.h"
#include "core/file.h"

namespace weft::render {
namespace {

constexpr std::uint64_t kObjLimitBytes = std::uint64_t{2} << 30;

[[noreturn]] void refuse(const std::string& name, const std::string& what,
                         core::Code code = core::Code::kInvalidArgument) {
  throw core::Error(code, name + ": " + what);
}

void take_points(const tinyobj::attrib_t& attributes, const std::string& name, ObjMesh& mesh) {
  for (std::size_t i = 0; i + 2 < attributes.vertices.size(); i += 3) {
    const glm::dvec3 point(attributes.vertices[i], attributes.vertices[i + 1],
                           attributes.vertices[i + 2]);
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.z)) {
      refuse(name, "point " + std::to_string(i / 3 + 1) + " is not finite; mend the mesh");
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
    if (!std::isfinite(triangle.texture[corner].x) || !std::isfinite(triangle.texture[corner].y)) {
      refuse(name, "a texture coordinate is not finite; mend the mesh");
    }
  }
  return triangle;
}

}  // namespace

ObjMesh read_obj(const std::filesystem::path& path) {
  return read_obj_text(core::read_file(path, kObjLimitBytes), path.string());
}

ObjMesh read_obj_text(const std::string& text, const std::string& name) {
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

}  // namespace weft::render
