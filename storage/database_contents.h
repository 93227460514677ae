#pragma once

#include "storage/dataset_source.h"
#include "storage/fabric_database.h"
#include "storage/recolouring.h"

namespace weft::storage {

// All that a source holds, checked: shapes and elements as the schema says and in agreement with
// each other, indices in range, numbers finite. Throws core::Error(kDataLoss) naming the dataset.
[[nodiscard]] FabricDatabase read_contents(DatasetSource& source);
[[nodiscard]] RecolourableDatabase read_all_contents(DatasetSource& source);

}  // namespace weft::storage
