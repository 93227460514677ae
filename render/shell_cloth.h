#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "render/cloth.h"
#include "render/obj_mesh.h"
#include "render/shell_geometry.h"

namespace weft::render {

struct ShellPlacement {
  glm::dvec2 texture_mm{0, 0};  // cloth that a unit of texture spans; 0: as the mesh's area has it
  double thickness_mm = 0;      // 0: the fabric's own
  bool flip_normals = false;
  bool black_underlay = false;
};

// Cloth mapped through a shell around a mesh, whose points are millimetres of the world. Adds to
// `remarks` what a person should know: folds, and triangles that can hold no cloth. `fabric` is
// shared by the pieces of one scene. Throws core::Error.
[[nodiscard]] std::unique_ptr<Cloth> make_shell_cloth(ClothFabric fabrics, const ObjMesh& mesh,
                                                      const ShellPlacement& placement,
                                                      std::vector<std::string>& remarks);

// The same of one fabric, which is shared by the pieces of one scene.
[[nodiscard]] std::unique_ptr<Cloth> make_shell_cloth(std::shared_ptr<const Fabric> fabric,
                                                      const ObjMesh& mesh,
                                                      const ShellPlacement& placement,
                                                      std::vector<std::string>& remarks);

}  // namespace weft::render
