#include "render/gpu/grid_cache.h"

#include <iterator>

namespace weft::render::gpu {

GridCache::Kept& GridCache::kept_for(const Fabric& fabric) {
  // Another fabric may by now live where one that is gone did.
  for (auto kept = kept_.begin(); kept != kept_.end();) {
    kept = kept->second.life.expired() ? kept_.erase(kept) : std::next(kept);
  }
  Kept& kept = kept_[&fabric];
  kept.life = fabric.life();
  return kept;
}

const FabricGrid& GridCache::grid_of(const Fabric& fabric, const GridSettings& settings) {
  Kept& kept = kept_for(fabric);
  if (kept.grid == nullptr || !(kept.grid_settings == settings)) {
    kept.grid = std::make_unique<FabricGrid>(build_fabric_grid(fabric.tile(), settings));
    kept.grid_settings = settings;
  }
  return *kept.grid;
}

const NearestVolume& GridCache::volume_of(const Fabric& fabric, double z_low_mm, double z_high_mm,
                                          std::uint64_t most_bytes) {
  Kept& kept = kept_for(fabric);
  const VolumeSettings settings{z_low_mm, z_high_mm, most_bytes};
  if (kept.volume == nullptr || !(kept.volume_settings == settings)) {
    kept.volume = std::make_unique<NearestVolume>(
        build_nearest_volume(fabric.tile(), z_low_mm, z_high_mm, most_bytes));
    kept.volume_settings = settings;
  }
  return *kept.volume;
}

}  // namespace weft::render::gpu
