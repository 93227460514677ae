#include "render/fabric.h"

#include <string>
#include <utility>

#include "core/check.h"
#include "core/error.h"

namespace weft::render {
namespace {

void require(bool condition, const std::string& what) {
  if (!condition) {
    throw core::Error(core::Code::kDataLoss, "the fabric database contradicts itself: " + what +
                                                 "; fetch or make it again");
  }
}

}  // namespace

Fabric::Fabric(fabric::Tile tile, std::vector<shading::FibreBcsdf> bcsdfs)
    : tile_(std::move(tile)), bcsdfs_(std::move(bcsdfs)), scene_(tile_) {
  CHECK_EQ(bcsdfs_.size(), tile_.material_names.size());
}

fabric::Tile tile_of(const storage::FabricDatabase& database) {
  const std::size_t strands = database.strand_radius_mm.size();
  require(database.strands.size() == 3 * strands && database.strand_periods.size() == 2 * strands,
          "its strands, their radii and their periods differ in number");
  require(database.threads.size() % 3 == 0 && database.points_mm.size() % 3 == 0,
          "its threads or points are not triples");
  fabric::Tile tile;
  tile.size_mm = database.size_mm;
  tile.z_min_mm = database.z_bounds_mm.x;
  tile.z_max_mm = database.z_bounds_mm.y;
  tile.blocks = database.blocks;
  tile.material_names = database.material_names;
  tile.yarn_names = database.yarn_names;
  for (std::size_t i = 0; i < database.threads.size(); i += 3) {
    require(database.threads[i + 1] <= 3, "a thread has an unknown role");
    tile.threads.push_back({database.threads[i], static_cast<fabric::Role>(database.threads[i + 1]),
                            database.threads[i + 2]});
  }
  std::uint32_t first_point = 0;
  for (std::size_t s = 0; s < strands; ++s) {
    fabric::Strand strand;
    strand.first_point = first_point;
    strand.point_count = database.strands[3 * s];
    strand.material = database.strands[3 * s + 1];
    strand.thread = database.strands[3 * s + 2];
    strand.radius_mm = database.strand_radius_mm[s];
    strand.period_x = database.strand_periods[2 * s];
    strand.period_y = database.strand_periods[2 * s + 1];
    first_point += strand.point_count;
    tile.strands.push_back(strand);
  }
  for (std::size_t i = 0; i < database.points_mm.size(); i += 3) {
    tile.points_mm.emplace_back(database.points_mm[i], database.points_mm[i + 1],
                                database.points_mm[i + 2]);
  }
  fabric::index_segments(tile);
  return tile;
}

std::unique_ptr<Fabric> Fabric::from_database(storage::FabricDatabase database, Wanted wanted,
                                              const PrecomputedSettings& settings) {
  require(database.materials.size() == database.material_names.size(),
          "its materials and their names differ in number");
  std::vector<shading::FibreBcsdf> bcsdfs;
  for (const shading::FibreMaterial& material : database.materials) {
    bcsdfs.emplace_back(material);
  }
  auto result = std::make_unique<Fabric>(tile_of(database), std::move(bcsdfs));
  if (wanted == Wanted::kFibresAndTransfer) {
    result->precomputed_ = std::make_unique<PrecomputedFabric>(std::move(database), settings);
  }
  return result;
}

}  // namespace weft::render
