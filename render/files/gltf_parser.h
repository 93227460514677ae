#pragma once

#include <string>

#include "core/sandbox_child.h"
#include "render/obj_mesh.h"

namespace weft::render {

inline constexpr const char* kGltfRequest = "gltf";

// Reads glTF 2.0, binary (.glb) or text (.gltf), with tinygltf in this very process: for the
// sandbox, and for who tests the parser. The triangles of the default scene's meshes, turned and
// moved as its nodes say, with TEXCOORD_0; v counts upwards, as in OBJ files. Points at one place
// become one, for glTF repeats a point where its texture or normal jumps. Buffers must be in the
// file; sparse accessors, compressed meshes, skins and morph targets are not applied: the first two
// are refused. Throws as read_mesh_text.
[[nodiscard]] ObjMesh parse_gltf(const std::string& bytes, const std::string& name);

// The sandbox's half of read_mesh_text for such files; mesh_from (obj_parser.h) is the other.
[[nodiscard]] core::SandboxHandler gltf_handler();

}  // namespace weft::render
