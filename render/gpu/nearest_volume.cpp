#include "render/gpu/nearest_volume.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "render/gpu/capsule_voxels.h"

namespace weft::render::gpu {
namespace {

VoxelFrame frame_of(const glm::dvec3& low_mm, const glm::dvec3& size_mm, double voxel_mm) {
  VoxelFrame frame;
  frame.low_mm = low_mm;
  for (int axis = 0; axis < 3; ++axis) {
    frame.voxels[axis] =
        static_cast<int>(std::clamp(std::ceil(size_mm[axis] / voxel_mm), 1.0, 1e6));
    frame.voxel_mm[axis] = size_mm[axis] / frame.voxels[axis];
  }
  return frame;
}

double count_of(const VoxelFrame& frame) {
  return static_cast<double>(frame.voxels.x) * frame.voxels.y * frame.voxels.z;
}

}  // namespace

NearestVolume build_nearest_volume(const fabric::Tile& tile, double z_low_mm, double z_high_mm,
                                   std::uint64_t most_bytes) {
  const std::vector<TileCapsule> capsules = capsules_in_tile(tile, 0);
  double voxel_mm = 1e30;
  for (const TileCapsule& capsule : capsules) {
    voxel_mm = std::min(voxel_mm, capsule.radius_mm);
  }
  const glm::dvec3 size(glm::dvec2(tile.size_mm), z_high_mm - z_low_mm);
  const double most = std::max(1.0, static_cast<double>(most_bytes) / sizeof(std::uint32_t));
  voxel_mm = std::max(voxel_mm, std::cbrt(size.x * size.y * size.z / most));
  VoxelFrame frame = frame_of({0, 0, z_low_mm}, size, voxel_mm);
  while (count_of(frame) > most && voxel_mm < size.x + size.y + size.z) {
    voxel_mm *= 1.05;
    frame = frame_of({0, 0, z_low_mm}, size, voxel_mm);
  }
  NearestVolume volume;
  volume.voxels = frame.voxels;
  volume.segments.assign(static_cast<std::size_t>(count_of(frame)), 0);
  std::vector<float> nearest(volume.segments.size(), 0.0f);
  for (const TileCapsule& capsule : capsules) {
    const glm::dvec3 middle = 0.5 * (capsule.a_mm + capsule.b_mm);
    visit_voxels(
        frame, capsule, capsule.radius_mm, [&](const glm::ivec3& voxel, const glm::dvec3& centre) {
          if (distance_from_axis(capsule, centre) > capsule.radius_mm) {
            return;
          }
          const auto i =
              static_cast<std::size_t>(voxel.x) +
              static_cast<std::size_t>(frame.voxels.x) *
                  (static_cast<std::size_t>(voxel.y) +
                   static_cast<std::size_t>(frame.voxels.y) * static_cast<std::size_t>(voxel.z));
          const auto distance = static_cast<float>(glm::distance(middle, centre));
          if (volume.segments[i] == 0 || distance < nearest[i]) {
            volume.segments[i] = capsule.segment + 1;
            nearest[i] = distance;
          }
        });
  }
  return volume;
}

}  // namespace weft::render::gpu
