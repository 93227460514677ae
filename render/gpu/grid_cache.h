#pragma once

#include <map>
#include <memory>

#include "render/fabric.h"
#include "render/gpu/fabric_grid.h"
#include "render/gpu/nearest_volume.h"

namespace weft::render::gpu {

// Keeps the grids of fabrics for as long as the fabrics live, so that the frames of an animation
// build them once. One thread.
class GridCache {
 public:
  // Built when it is not kept, or was built with other settings. The references hold until the next
  // call for the same fabric, or until the fabric is gone. Throw what build_fabric_grid throws.
  [[nodiscard]] const FabricGrid& grid_of(const Fabric& fabric, const GridSettings& settings);
  [[nodiscard]] const NearestVolume& volume_of(const Fabric& fabric, double z_low_mm,
                                               double z_high_mm, std::uint64_t most_bytes);

  // How many fabrics are kept.
  [[nodiscard]] std::size_t size() const { return kept_.size(); }

 private:
  struct VolumeSettings {
    double z_low_mm = 0;
    double z_high_mm = 0;
    std::uint64_t most_bytes = 0;
    bool operator==(const VolumeSettings&) const = default;
  };
  struct Kept {
    std::weak_ptr<const void> life;
    std::unique_ptr<FabricGrid> grid;
    GridSettings grid_settings;
    std::unique_ptr<NearestVolume> volume;
    VolumeSettings volume_settings;
  };
  Kept& kept_for(const Fabric& fabric);

  std::map<const Fabric*, Kept> kept_;
};

}  // namespace weft::render::gpu
