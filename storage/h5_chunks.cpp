#include "storage/h5_chunks.h"

#include <optional>
#include <string>
#include <vector>

#include <hdf5.h>

#include "storage/h5_reader.h"
#include "storage/h5_types.h"

namespace weft::storage::h5 {

namespace {

constexpr std::uint64_t kIndexBytes = 16;  // of a chunk in the file, at least
constexpr std::uint64_t kFletcherBytes = 4;

using Coordinates = std::vector<hsize_t>;

// The chunks of a dataset: small enough, and as many as the file can index. Returns how many the
// shape needs.
std::uint64_t check_chunks(Id properties, const std::string& path, const DatasetSource::Info& info,
                           std::uint64_t file_bytes) {
  std::vector<hsize_t> chunk(info.shape.size());
  const int rank = static_cast<int>(chunk.size());
  if (H5Pget_chunk(properties, rank, chunk.data()) != rank) {
    throw_damaged(path, "has damaged chunks");
  }
  std::uint64_t chunks = 1;
  for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
    if (chunk[axis] == 0 || chunk[axis] > info.shape[axis]) {
      throw_damaged(path, "has chunks that are larger than itself");
    }
    const std::uint64_t along = (info.shape[axis] - 1) / chunk[axis] + 1;
    if (along > file_bytes / kIndexBytes / chunks + 1) {
      throw_damaged(path, "has more chunks than the file can hold");
    }
    chunks *= along;
  }
  const auto chunk_bytes = bytes_of(Shape(chunk.begin(), chunk.end()), info.element_bytes);
  if (!chunk_bytes || *chunk_bytes > kChunkLimitBytes) {
    throw_damaged(
        path, "has chunks above the limit of " + std::to_string(kChunkLimitBytes >> 20) + " MiB");
  }
  return chunks;
}

void check_filters(Id properties, const std::string& path) {
  constexpr int kFiltersLimit = 3;
  const int filters = H5Pget_nfilters(properties);
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(properties, static_cast<unsigned>(i), &flags,
                                               &values, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_DEFLATE &&
        filter != H5Z_FILTER_FLETCHER32) {
      throw_damaged(path, "uses a filter that fabric databases do not have");
    }
  }
  if (filters < 0 || filters > kFiltersLimit) {
    throw_damaged(path, "has damaged filters");
  }
}

// What deflate makes of a chunk that it cannot shorten, with room for checksums.
std::uint64_t longest_stored(std::uint64_t chunk_bytes) {
  constexpr std::uint64_t kOverheadBytes = 64;
  return chunk_bytes + chunk_bytes / 1000 + kOverheadBytes;
}

std::vector<H5Z_filter_t> filters_of(Id properties) {
  std::vector<H5Z_filter_t> filters;
  for (int i = 0; i < H5Pget_nfilters(properties); ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    filters.push_back(H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &values, nullptr,
                                     0, nullptr, nullptr));
  }
  return filters;
}

// How long a chunk is in the file when it is not deflated; nothing when it is. A bit of `skipped`
// stands for a filter that was left out.
std::optional<std::uint64_t> plain_bytes(const std::vector<H5Z_filter_t>& filters,
                                         std::uint32_t skipped, std::uint64_t chunk_bytes) {
  std::uint64_t bytes = chunk_bytes;
  for (std::size_t i = 0; i < filters.size(); ++i) {
    if ((skipped >> i & 1) != 0) {
      continue;
    }
    if (filters[i] == H5Z_FILTER_DEFLATE) {
      return std::nullopt;
    }
    bytes += filters[i] == H5Z_FILTER_FLETCHER32 ? kFletcherBytes : 0;
  }
  return bytes;
}

// To the next chunk, in the order of their coordinates; whether there is one.
bool advance(Coordinates& at, const Coordinates& chunk, const Shape& shape) {
  for (std::size_t axis = at.size(); axis-- > 0;) {
    at[axis] += chunk[axis];
    if (at[axis] < shape[axis]) {
      return true;
    }
    at[axis] = 0;
  }
  return false;
}

}  // namespace

void check_storage(Id dataset, const std::string& path, const DatasetSource::Info& info,
                   std::uint64_t file_bytes) {
  const Handle properties(H5Dget_create_plist(dataset));
  if (properties.id() < 0 || H5Pget_layout(properties.id()) != H5D_CHUNKED ||
      H5Pget_external_count(properties.id()) != 0) {
    throw_damaged(path, "is not stored in chunks inside the file");
  }
  unsigned options = 0;
  if (H5Pget_chunk_opts(properties.id(), &options) < 0 || options != 0) {
    throw_damaged(path, "has chunks of a kind that fabric databases do not have");
  }
  check_filters(properties.id(), path);
  const std::uint64_t chunks = check_chunks(properties.id(), path, info, file_bytes);
  const Handle space(H5Dget_space(dataset));
  hsize_t stored = 0;
  if (H5Dget_num_chunks(dataset, space.id(), &stored) < 0 || stored != chunks) {
    throw_damaged(path, "has " + std::to_string(stored) + " chunks where its shape needs " +
                            std::to_string(chunks));
  }
}

void check_chunk_lengths(Id dataset, const std::string& path, const DatasetSource::Info& info) {
  const Handle properties(H5Dget_create_plist(dataset));
  const std::vector<H5Z_filter_t> filters = filters_of(properties.id());
  Coordinates chunk(info.shape.size());
  if (H5Pget_chunk(properties.id(), static_cast<int>(chunk.size()), chunk.data()) < 0) {
    throw_damaged(path, "has damaged chunks");
  }
  const std::uint64_t chunk_bytes =
      bytes_of(Shape(chunk.begin(), chunk.end()), info.element_bytes).value_or(0);
  std::vector<char> stored;
  Coordinates at(chunk.size(), 0);
  do {
    hsize_t stored_bytes = 0;
    if (H5Dget_chunk_storage_size(dataset, at.data(), &stored_bytes) < 0 || stored_bytes == 0 ||
        stored_bytes > longest_stored(chunk_bytes)) {
      throw_damaged(path, "has chunks of impossible lengths");
    }
    stored.resize(stored_bytes);
    std::uint32_t skipped = 0;
    if (H5Dread_chunk(dataset, H5P_DEFAULT, at.data(), &skipped, stored.data()) < 0) {
      throw_damaged(path, "has damaged chunks");
    }
    const auto plain = plain_bytes(filters, skipped, chunk_bytes);
    if (plain && *plain != stored_bytes) {
      throw_damaged(path, "has chunks that are shorter or longer than they should be");
    }
  } while (advance(at, chunk, info.shape));
}

}  // namespace weft::storage::h5
