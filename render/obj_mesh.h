#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace weft::render {

// A triangle mesh with texture coordinates at the triangles' corners, so that one point may have
// several.
struct ObjMesh {
  struct Triangle {
    std::array<std::uint32_t, 3> points;
    std::array<glm::dvec2, 3> texture;
  };
  std::vector<glm::dvec3> points;
  std::vector<Triangle> triangles;
};

inline constexpr std::size_t kTriangleLimit = 4'000'000;

// Reads a Wavefront OBJ file; polygons are cut into triangles, triangles without area left out.
// The text is parsed in the sandbox (core/sandbox.h). Throws core::Error: kNotFound when there is
// no such file, kInvalidArgument when it is no OBJ file, a corner lacks texture coordinates, a
// number is not finite or beyond 1e9, or there is no triangle, and kResourceExhausted above
// kTriangleLimit and the limits of render/files/obj_parser.h.
[[nodiscard]] ObjMesh read_obj(const std::filesystem::path& path);

// The same from memory; `name` stands for the file in messages.
[[nodiscard]] ObjMesh read_obj_text(const std::string& text, const std::string& name);

// Whether a file of this name is glTF, whose unit is the metre and whose y is up.
[[nodiscard]] bool is_gltf_name(const std::string& name);

// A mesh of the format that the name's extension tells: glTF 2.0 (.glb, .gltf, its buffers within
// it), else OBJ. Throws as read_obj.
[[nodiscard]] ObjMesh read_mesh_text(const std::string& bytes, const std::string& name);

}  // namespace weft::render
