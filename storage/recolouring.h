#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/digest.h"
#include "storage/fabric_database.h"

namespace weft::storage {

// What a fabric database holds for the sake of other colours, and no renderer reads
// (docs/database_format.md, "Orders of scattering").
struct Recolouring {
  // Light of the cells by orders of scattering (shading/scattering_orders.h), halves: all three are
  // empty where it is not known.
  std::vector<std::uint16_t> order_light;   // [cells, groups, 11, 3]
  std::vector<std::uint16_t> order_counts;  // [cells, groups, 11, 3, 1 + 2 materials]
  std::vector<std::uint16_t> order_shapes;  // [cells, 4, low, low]
  // JSON that says from what the light was carried over, and how far it is off; empty where it was
  // traced in the colours of the database.
  std::string carried_over_json;

  [[nodiscard]] bool has_orders() const { return !order_light.empty(); }
};

// write_database with these datasets beside its own.
core::Digest write_database(const FabricDatabase& database, const Recolouring& recolouring,
                            const std::filesystem::path& path);

// A database with all that is in its file. Throws as read_database.
struct RecolourableDatabase {
  FabricDatabase database;
  Recolouring recolouring;
};
[[nodiscard]] RecolourableDatabase read_recolourable(const std::filesystem::path& path);

}  // namespace weft::storage
