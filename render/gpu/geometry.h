#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/cloth.h"
#include "render/kernels/cloth_records.h"

namespace weft::render::gpu {

// Pieces of cloth as kernels read them: what render/kernels/cloth_records.h describes.
struct GeometryArrays {
  std::vector<shading::DeviceCloth> cloths;
  std::vector<shading::DeviceTetrahedron> tetrahedra;
  std::vector<shading::DeviceShellTriangle> shell_triangles;
  std::vector<shading::DeviceNode> nodes;
  std::vector<shading::DeviceOuterFace> outer_faces;
  std::vector<const Fabric*> fabrics;  // each once; DeviceCloth::fabric is an index of it
};

// Throws core::Error(kResourceExhausted) with figures when a shell has more tetrahedra than an
// index can name. The fabrics must outlive the arrays.
[[nodiscard]] GeometryArrays pack_geometry(std::span<const std::unique_ptr<Cloth>> cloths);

}  // namespace weft::render::gpu

// What the shared text of render/kernels needs to be called from C++: the buffers are arrays.
namespace weft::shading {

using std::fma;

using Geometry = const render::gpu::GeometryArrays*;

[[nodiscard]] inline DeviceCloth cloth_at(Geometry g, int index) {
  return g->cloths[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline DeviceTetrahedron tetrahedron_at(Geometry g, int index) {
  return g->tetrahedra[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline DeviceShellTriangle shell_triangle_at(Geometry g, int index) {
  return g->shell_triangles[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline DeviceNode node_at(Geometry g, int index) {
  return g->nodes[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline DeviceOuterFace outer_face_at(Geometry g, int index) {
  return g->outer_faces[static_cast<std::size_t>(index)];
}

}  // namespace weft::shading
