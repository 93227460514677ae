#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "storage/dataset_source.h"
#include "storage/h5.h"
#include "storage/h5_reader.h"

// What the chunks of a dataset hold: a part of storage/h5_reader.

namespace weft::storage::h5 {

// Rows of the first axis.
struct Rows {
  std::uint64_t first = 0;
  std::uint64_t count = 0;
};

// Reads these rows into `out`. The library hands over chunks as they are stored, and knows nothing
// of what becomes of them; where all threads take part, some 16 MiB of chunks are in work at a
// time. Throws core::Error(kDataLoss) naming the dataset when a chunk is missing, when its checksum
// or its compression does not hold, and when it holds more or less than its shape. REQUIRES:
// check_storage passed, and `out` has the size of the rows.
void read_chunks(Id dataset, const std::string& path, const DatasetSource::Info& info, Rows rows,
                 Decoding decoding, std::span<std::byte> out);

}  // namespace weft::storage::h5
