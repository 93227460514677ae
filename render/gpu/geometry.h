#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/cloth.h"
#include "render/gpu/fabric_grid.h"
#include "render/gpu/grid_cache.h"
#include "render/kernels/cloth_records.h"
#include "render/kernels/grid_records.h"

namespace weft::render::gpu {

// Pieces of cloth and the fibres of their fabrics as kernels read them: what
// render/kernels/cloth_records.h and grid_records.h describe. A fabric's arrays are there once,
// however many pieces are of it.
struct GeometryArrays {
  std::vector<shading::DeviceCloth> cloths;
  std::vector<shading::DeviceTetrahedron> tetrahedra;
  std::vector<shading::DeviceShellTriangle> shell_triangles;
  std::vector<shading::DeviceNode> nodes;
  std::vector<shading::DeviceOuterFace> outer_faces;

  std::vector<shading::DeviceFabric> fabrics;
  std::vector<std::int32_t> bricks;
  std::vector<std::uint32_t> voxels;
  std::vector<std::uint32_t> entries;
  std::vector<shading::DeviceCapsule> capsules;
  std::vector<std::uint32_t> segments;
  std::vector<std::uint32_t> nearest;
  std::vector<std::int32_t> patterns;

  std::vector<const Fabric*> sources;  // of `fabrics`; DeviceHit::fabric is an index of both

  // Indices of the fabrics that a piece shows, each once, in rising order.
  [[nodiscard]] std::vector<int> fabrics_of(std::size_t cloth) const;
  // Bytes of device memory that the arrays take.
  [[nodiscard]] std::uint64_t size_bytes() const;
};

struct GeometrySettings {
  GridSettings grid;
  bool nearest_volume = false;                                 // the paper's, besides
  std::uint64_t most_nearest_bytes = std::uint64_t{96} << 20;  // of one fabric
};

// Throws core::Error(kResourceExhausted) with figures when a fabric's fibres or a shell are too
// many to be named or held. Takes grids from `cache`, when given, and leaves new ones there. The
// fabrics must outlive the arrays. REQUIRES: a piece of cloth.
[[nodiscard]] GeometryArrays pack_geometry(std::span<const std::unique_ptr<Cloth>> cloths,
                                           const GeometrySettings& settings = {},
                                           GridCache* cache = nullptr);

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
[[nodiscard]] inline DeviceFabric fabric_at(Geometry g, int index) {
  return g->fabrics[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline int brick_at(Geometry g, int index) {
  return g->bricks[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline uint voxel_at(Geometry g, int index) {
  return g->voxels[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline uint entry_at(Geometry g, uint index) { return g->entries[index]; }
[[nodiscard]] inline DeviceCapsule capsule_at(Geometry g, int index) {
  return g->capsules[static_cast<std::size_t>(index)];
}
[[nodiscard]] inline int segment_at(Geometry g, int index) {
  return static_cast<int>(g->segments[static_cast<std::size_t>(index)]);
}
[[nodiscard]] inline int nearest_at(Geometry g, int index) {
  return static_cast<int>(g->nearest[static_cast<std::size_t>(index)]) - 1;
}
[[nodiscard]] inline int pattern_at(Geometry g, int index) {
  return g->patterns[static_cast<std::size_t>(index)];
}

}  // namespace weft::shading
