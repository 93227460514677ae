#pragma once

#include <cstdint>
#include <vector>

#include "fabric/tile.h"
#include "render/kernels/grid_records.h"

namespace weft::render::gpu {

struct GridSettings {
  // Of one fabric's grid. The voxels grow until it fits.
  std::uint64_t most_bytes = std::uint64_t{96} << 20;
  // Capsules that a voxel among the fibres lists on average, as far as memory permits: more make
  // the march slower, fewer the grid larger.
  double capsules_per_voxel = 3;
  bool operator==(const GridSettings&) const = default;
};

// The arrays of render/kernels/grid_records.h for one fabric. Indices count from these arrays' own
// beginnings.
struct FabricGrid {
  shading::DeviceFabric fabric{};
  std::vector<std::int32_t> bricks;   // first voxel; -1: nothing reaches into the brick
  std::vector<std::uint32_t> voxels;  // first entry, and one number more at the end
  std::vector<std::uint32_t> entries;
  std::vector<shading::DeviceCapsule> capsules;
  std::vector<std::uint32_t> segments;  // of the tile, for each capsule

  [[nodiscard]] std::uint64_t size_bytes() const;
};

// Throws core::Error(kResourceExhausted) with figures when the fibres alone need more than
// settings.most_bytes. REQUIRES: the tile has a segment.
[[nodiscard]] FabricGrid build_fabric_grid(const fabric::Tile& tile, const GridSettings& settings);

}  // namespace weft::render::gpu
