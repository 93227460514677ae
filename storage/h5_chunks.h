#pragma once

#include <cstdint>
#include <string>

#include "storage/dataset_source.h"
#include "storage/h5.h"

// How the chunks of a dataset may lie in a file that may be hostile: a part of storage/h5_reader.

namespace weft::storage::h5 {

// Whether every filter is one of ours, in our order, and all data lies chunk by chunk in this very
// file. Throws core::Error(kDataLoss) naming the dataset.
void check_storage(Id dataset, const std::string& path, const DatasetSource::Info& info,
                   std::uint64_t file_bytes);

}  // namespace weft::storage::h5
