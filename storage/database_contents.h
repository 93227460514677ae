#pragma once

#include "storage/dataset_source.h"
#include "storage/fabric_database.h"

namespace weft::storage {

// All that a source holds, checked: shapes and elements as the schema says and in agreement with
// each other, indices in range, numbers finite. Throws core::Error(kDataLoss) naming the dataset.
[[nodiscard]] FabricDatabase read_contents(DatasetSource& source);

}  // namespace weft::storage
