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

// Where a filter stands among those of a dataset; nothing when it is none of ours.
std::optional<int> order_of(H5Z_filter_t filter) {
  switch (filter) {
    case H5Z_FILTER_SHUFFLE:
      return 0;
    case H5Z_FILTER_DEFLATE:
      return 1;
    case H5Z_FILTER_FLETCHER32:
      return 2;
    default:
      return std::nullopt;
  }
}

void check_filters(Id properties, const std::string& path, std::uint64_t element_bytes) {
  const int filters = H5Pget_nfilters(properties);
  int last = -1;
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    unsigned value = 0;
    std::size_t values = 1;
    const H5Z_filter_t filter = H5Pget_filter2(properties, static_cast<unsigned>(i), &flags,
                                               &values, &value, 0, nullptr, nullptr);
    const std::optional<int> order = order_of(filter);
    if (!order) {
      throw_damaged(path, "uses a filter that fabric databases do not have");
    }
    if (*order <= last) {
      throw_damaged(path, "uses filters in an order that fabric databases do not have");
    }
    if (filter == H5Z_FILTER_SHUFFLE && (values != 1 || value != element_bytes)) {
      throw_damaged(path, "is shuffled by another size than that of its elements");
    }
    last = *order;
  }
  if (filters < 0) {
    throw_damaged(path, "has damaged filters");
  }
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
  check_filters(properties.id(), path, info.element_bytes);
  const std::uint64_t chunks = check_chunks(properties.id(), path, info, file_bytes);
  const Handle space(H5Dget_space(dataset));
  hsize_t stored = 0;
  if (H5Dget_num_chunks(dataset, space.id(), &stored) < 0 || stored != chunks) {
    throw_damaged(path, "has " + std::to_string(stored) + " chunks where its shape needs " +
                            std::to_string(chunks));
  }
}

}  // namespace weft::storage::h5
