#pragma once

#include <cstdint>
#include <span>

#include <glm/vec3.hpp>

#include "render/kernels/cloth_records.h"
#include "render/kernels/grid_records.h"
#include "render/kernels/hit.h"

namespace weft::bench {

// What one item of a stage asks of the device: bytes that its text reads and writes, whether caches
// serve them or not, and operations, of which a multiplication, an addition, a comparison, a
// division and a root each count as one.
struct Work {
  double bytes = 0;
  double operations = 0;
};

// The arrays of render::gpu::GeometryArrays.
struct GeometryView {
  std::span<const shading::DeviceCloth> cloths;
  std::span<const shading::DeviceTetrahedron> tetrahedra;
  std::span<const shading::DeviceShellTriangle> shell_triangles;
  std::span<const shading::DeviceNode> nodes;
  std::span<const shading::DeviceOuterFace> outer_faces;
  std::span<const shading::DeviceFabric> fabrics;
  std::span<const std::int32_t> bricks;
  std::span<const std::uint32_t> voxels;
  std::span<const std::uint32_t> entries;
  std::span<const shading::DeviceCapsule> capsules;
  std::span<const std::uint32_t> segments;
  std::span<const std::int32_t> patterns;
};

struct WorldRay {
  glm::vec3 origin_mm;
  glm::vec3 direction;  // unit
};

// Means over the rays, counted by running the kernels' text on the host.
[[nodiscard]] Work eye_ray_work(const GeometryView& geometry, std::span<const WorldRay> rays);
// ... over the hits that are of fibres.
[[nodiscard]] Work shadow_ray_work(const GeometryView& geometry,
                                   std::span<const shading::DeviceHit> hits, glm::vec3 to_light);

}  // namespace weft::bench
