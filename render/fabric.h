#pragma once

#include <memory>
#include <vector>

#include "fabric/tile.h"
#include "render/precomputed_fabric.h"
#include "shading/fibre_bcsdf.h"
#include "storage/fabric_database.h"
#include "transport/scene.h"

namespace weft::render {

// What tracing rays through a fabric needs: its fibres, their ray-tracing structure and their
// BCSDFs. Immutable: any thread may call.
class Fabric {
 public:
  // REQUIRES: one BCSDF per material of the tile, and a tile that index_segments accepts. Throws
  // what transport::Scene throws.
  Fabric(fabric::Tile tile, std::vector<shading::FibreBcsdf> bcsdfs);

  // The tile and the materials of a database, and its precomputed visibility and transfer where
  // they are wanted. Throws core::Error(kDataLoss) when its arrays contradict one another.
  enum class Wanted { kFibres, kFibresAndTransfer };
  [[nodiscard]] static std::unique_ptr<Fabric> from_database(
      storage::FabricDatabase database, Wanted wanted, const PrecomputedSettings& settings = {});

  [[nodiscard]] const fabric::Tile& tile() const { return tile_; }
  [[nodiscard]] const transport::Scene& scene() const { return scene_; }
  [[nodiscard]] const std::vector<shading::FibreBcsdf>& bcsdfs() const { return bcsdfs_; }
  [[nodiscard]] const shading::FibreBcsdf& bcsdf_of_strand(std::uint32_t strand) const {
    return bcsdfs_[tile_.strands[strand].material];
  }
  // Nothing when it was not wanted, or there is none.
  [[nodiscard]] const PrecomputedFabric* precomputed() const { return precomputed_.get(); }
  // Expires with this object: lets those who keep something made of it know when it is gone.
  [[nodiscard]] std::weak_ptr<const void> life() const { return life_; }

 private:
  fabric::Tile tile_;
  std::vector<shading::FibreBcsdf> bcsdfs_;
  std::unique_ptr<const PrecomputedFabric> precomputed_;
  transport::Scene scene_;  // refers to tile_; a Fabric never moves
  std::shared_ptr<const void> life_ = std::make_shared<char>();  // shared: watched by life()
};

// The tile that a database holds, indexed.
[[nodiscard]] fabric::Tile tile_of(const storage::FabricDatabase& database);

}  // namespace weft::render
