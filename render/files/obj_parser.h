#pragma once

#include <cstdint>
#include <string>

#include "core/sandbox_child.h"
#include "render/obj_mesh.h"

namespace weft::render {

inline constexpr const char* kObjRequest = "obj";
// An OBJ file may be so long, have so many points, and coordinates of that size.
inline constexpr std::uint64_t kObjLimitBytes = std::uint64_t{512} << 20;
inline constexpr std::size_t kPointLimit = 3 * kTriangleLimit;
inline constexpr double kCoordinateLimit = 1e9;

// Reads with tinyobjloader in this very process: for the sandbox, and for who tests the parser.
// Throws as read_obj.
[[nodiscard]] ObjMesh parse_obj(const std::string& text, const std::string& name);

// What no parser of meshes lets through; not what is no number, either.
[[nodiscard]] bool is_usable(double value);
[[nodiscard]] bool is_usable(const glm::dvec3& point);
[[nodiscard]] bool is_usable(const glm::dvec2& place);

// Writes a mesh as mesh_from reads it.
void hand_over(const ObjMesh& mesh, core::FlatWriter& answer);

// The sandbox's half of read_obj.
[[nodiscard]] core::SandboxHandler obj_handler();
// What the handler hands back, checked. Throws core::Error(kDataLoss) when it is not whole.
[[nodiscard]] ObjMesh mesh_from(core::FlatReader answer);

}  // namespace weft::render
