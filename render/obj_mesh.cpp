#include "render/obj_mesh.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "core/error.h"
#include "core/input_file.h"
#include "core/sandbox.h"
#include "render/files/gltf_parser.h"
#include "render/files/obj_parser.h"

namespace weft::render {
namespace {

ObjMesh read_apart(const core::InputFile& file, const char* request) {
  if (file.size_bytes() > kObjLimitBytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      file.name() + " is larger than the limit of " +
                          std::to_string(kObjLimitBytes) + " bytes of a mesh; use a coarser one");
  }
  constexpr std::uint64_t kFormBytes = std::uint64_t{1} << 20;
  core::SandboxLimits limits;
  // A face of eight bytes becomes lists of a few hundred in the library; a real one is longer.
  limits.memory_bytes =
      std::min((std::uint64_t{256} << 20) + 40 * file.size_bytes(), std::uint64_t{6} << 30);
  limits.answer_bytes =
      kFormBytes + kPointLimit * sizeof(glm::dvec3) + kTriangleLimit * sizeof(ObjMesh::Triangle);
  limits.cpu_s = 20 + file.size_bytes() / (std::uint64_t{2} << 20);
  const core::SandboxAnswer answer = core::read_in_sandbox(file, {request, file.name()}, limits);
  return mesh_from(core::FlatReader(answer.bytes()));
}

}  // namespace

ObjMesh read_obj(const std::filesystem::path& path) {
  return read_apart(core::InputFile(path), kObjRequest);
}

ObjMesh read_obj_text(const std::string& text, const std::string& name) {
  return read_apart(core::InputFile(text, name), kObjRequest);
}

bool is_gltf_name(const std::string& name) {
  std::string extension = std::filesystem::path(name).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".glb" || extension == ".gltf";
}

ObjMesh read_mesh_text(const std::string& bytes, const std::string& name) {
  return read_apart(core::InputFile(bytes, name), is_gltf_name(name) ? kGltfRequest : kObjRequest);
}

}  // namespace weft::render
