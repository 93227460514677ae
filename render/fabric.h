#pragma once

#include <memory>
#include <vector>

#include "fabric/tile.h"
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

  // The tile and the materials of a database. Throws core::Error(kDataLoss) when its arrays
  // contradict one another.
  [[nodiscard]] static std::unique_ptr<Fabric> from_database(
      const storage::FabricDatabase& database);

  [[nodiscard]] const fabric::Tile& tile() const { return tile_; }
  [[nodiscard]] const transport::Scene& scene() const { return scene_; }
  [[nodiscard]] const shading::FibreBcsdf& bcsdf_of_strand(std::uint32_t strand) const {
    return bcsdfs_[tile_.strands[strand].material];
  }

 private:
  fabric::Tile tile_;
  std::vector<shading::FibreBcsdf> bcsdfs_;
  transport::Scene scene_;  // refers to tile_; a Fabric never moves
};

// The tile that a database holds, indexed.
[[nodiscard]] fabric::Tile tile_of(const storage::FabricDatabase& database);

}  // namespace weft::render
