#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace weft::storage::h5 {

// A chunk of a dataset as it stands in a file.
struct FilteredChunk {
  std::string bytes;
  std::uint32_t skipped = 0;  // bit i: filter i of the dataset was left out
};

// What HDF5's own filters make of chunks of `chunk_bytes` of plain data (the last one is filled up
// with zeros): shuffle and deflate where `compress`, then Fletcher's checksum. Deflate is left out
// of chunks that it would not shorten. By all threads of the machine; the same bytes on any number
// of them. REQUIRES: chunk_bytes and data.size() are multiples of element_bytes, and positive.
[[nodiscard]] std::vector<FilteredChunk> filtered_chunks(std::span<const std::byte> data,
                                                         std::size_t chunk_bytes,
                                                         std::size_t element_bytes, bool compress);

// What was done to a chunk, in this order.
struct ChunkFilters {
  bool shuffle = false;
  bool deflate = false;
  bool fletcher32 = false;
};

// Undoes what was done to the chunk `stored`: `data`, which has its full size, is what it held.
// Returns false when the checksum or the compression does not hold, or it held more or less than
// that; `data` may be anything then. Takes memory for `data` once more. Any thread may call, on
// bytes from anywhere. REQUIRES: data.size() is a multiple of element_bytes.
[[nodiscard]] bool undo_filters(std::string_view stored, const ChunkFilters& filters,
                                std::size_t element_bytes, std::span<std::byte> data);

}  // namespace weft::storage::h5
