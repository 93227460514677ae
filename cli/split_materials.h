#pragma once

#include <set>
#include <string>
#include <vector>

#include "cli/colourway_source.h"
#include "storage/fabric_database.h"

namespace weft::cli {

// Yarns whose fibres of a material become fibres of a new one, of the same look, that can be dyed
// by itself.
struct MaterialSplit {
  std::size_t material = 0;
  std::set<std::size_t> yarns;
  std::string name;  // of the new material
};

// What has to be split so that yarns can be dyed as `requests` ask (colour_targets.h): yarns of one
// material that shall have different colours, or of which some shall keep theirs. Those that keep
// theirs keep their material. Throws as colour_targets.
[[nodiscard]] std::vector<MaterialSplit> material_splits(const std::vector<std::string>& requests,
                                                         const storage::FabricDatabase& database);

// The splits that a colourway was made with, of the fabric that its light was carried over from.
// Throws core::Error(kDataLoss) when it was made from another one.
[[nodiscard]] std::vector<MaterialSplit> splits_between(const storage::FabricDatabase& base,
                                                        const storage::FabricDatabase& colourway);

// Splits the materials of the fabric and of its description. How the light that met a material is
// shared among its parts is known of no cell: paths are traced in some cells in the old colours,
// and what they met in the cells of a yarn is taken for what light meets there everywhere. Throws
// core::Error(kFailedPrecondition) when the fabric tells orders of scattering apart, and would have
// more materials than are counted.
void split_materials(const std::vector<MaterialSplit>& splits, ColourwaySource& fabric,
                     unsigned threads);

}  // namespace weft::cli
