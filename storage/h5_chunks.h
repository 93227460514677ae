#pragma once

#include <cstdint>
#include <string>

#include "storage/dataset_source.h"
#include "storage/h5.h"

// How the chunks of a dataset may lie in a file that may be hostile: a part of storage/h5_reader.
// Both throw core::Error(kDataLoss) naming the dataset.

namespace weft::storage::h5 {

// Whether every filter is one of ours, and all data lies chunk by chunk in this very file.
void check_storage(Id dataset, const std::string& path, const DatasetSource::Info& info,
                   std::uint64_t file_bytes);

// Whether every chunk is there, and one whose deflation was left out has the length of its shape:
// the library takes what the file says for the chunk, and reads on behind it. Costs a copy of what
// is stored. REQUIRES: check_storage passed.
void check_chunk_lengths(Id dataset, const std::string& path, const DatasetSource::Info& info);

}  // namespace weft::storage::h5
