#pragma once

#include <cstdint>

#include "storage/fabric_database.h"

namespace weft::storage {

// A database with less in it, for studies of what each part is worth (docs/accuracy.md): what is
// returned draws as if it had been made so. Neither is ever written to a file.

// Harmonics up to `sh_order`. REQUIRES: sh_order <= database.sh_order.
[[nodiscard]] FabricDatabase with_sh_order(FabricDatabase database, std::uint32_t sh_order);

// The first `components` principal components of visibility. REQUIRES: components <=
// database.pca_components.
[[nodiscard]] FabricDatabase with_components(FabricDatabase database, std::uint32_t components);

// Transfer matrices, tables of the BCSDF and the visibility basis rounded to binary16, as a device
// may keep them.
[[nodiscard]] FabricDatabase in_half_precision(FabricDatabase database);

}  // namespace weft::storage
