#include "storage/h5_chunk_reader.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include <hdf5.h>

#include "core/parallel.h"
#include "storage/h5_filters.h"
#include "storage/h5_types.h"

namespace weft::storage::h5 {

namespace {

constexpr std::uint64_t kBatchBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kBatchChunks = 256;
constexpr std::uint64_t kFletcherBytes = 4;

using Coordinates = std::vector<hsize_t>;

struct Stored {
  Coordinates at;
  std::string bytes;
  ChunkFilters filters;
};

// What deflate makes of a chunk that it cannot shorten, with room for checksums.
std::uint64_t longest_stored(std::uint64_t chunk_bytes) {
  constexpr std::uint64_t kOverheadBytes = 64;
  return chunk_bytes + chunk_bytes / 1000 + kOverheadBytes;
}

// To the next chunk before `end`, in the order of their coordinates; whether there is one.
bool advance(Coordinates& at, const Coordinates& chunk, const Coordinates& end) {
  for (std::size_t axis = at.size(); axis-- > 1;) {
    at[axis] += chunk[axis];
    if (at[axis] < end[axis]) {
      return true;
    }
    at[axis] = 0;
  }
  at[0] += chunk[0];
  return at[0] < end[0];
}

class ChunkReader {
 public:
  ChunkReader(Id dataset, const std::string& path, const DatasetSource::Info& info, Rows rows)
      : dataset_(dataset),
        path_(path),
        element_bytes_(info.element_bytes),
        rows_(rows),
        chunk_(info.shape.size()),
        end_(info.shape.begin(), info.shape.end()) {
    const Handle properties(H5Dget_create_plist(dataset));
    if (H5Pget_chunk(properties.id(), static_cast<int>(chunk_.size()), chunk_.data()) < 0) {
      throw_damaged(path, "has damaged chunks");
    }
    for (int i = 0; i < H5Pget_nfilters(properties.id()); ++i) {
      unsigned flags = 0;
      std::size_t values = 0;
      filters_.push_back(H5Pget_filter2(properties.id(), static_cast<unsigned>(i), &flags, &values,
                                        nullptr, 0, nullptr, nullptr));
    }
    end_[0] = rows.first + rows.count;
    chunk_bytes_ = bytes_of(Shape(chunk_.begin(), chunk_.end()), element_bytes_).value_or(0);
    // Axes that every chunk spans are part of what lies together.
    run_bytes_ = element_bytes_;
    for (run_axis_ = chunk_.size() - 1; run_axis_ > 0 && chunk_[run_axis_] == end_[run_axis_];
         --run_axis_) {
      run_bytes_ *= chunk_[run_axis_];
    }
  }

  void read(Decoding decoding, std::span<std::byte> out) const {
    const bool is_alone = decoding == Decoding::kInThisThread;
    std::vector<Stored> batch(
        is_alone ? 1 : std::clamp<std::uint64_t>(kBatchBytes / chunk_bytes_, 1, kBatchChunks));
    Coordinates at(chunk_.size(), 0);
    at[0] = rows_.first / chunk_[0] * chunk_[0];
    for (bool has_more = true; has_more;) {
      std::size_t count = 0;
      for (; count < batch.size() && has_more; ++count) {
        batch[count].at = at;
        fetch(batch[count]);
        has_more = advance(at, chunk_, end_);
      }
      if (is_alone) {
        decode(batch.front(), out);
      } else {
        core::in_parallel(count, [&](std::size_t i) { decode(batch[i], out); });
      }
    }
  }

 private:
  // The library takes what the file says for the length of a chunk.
  void fetch(Stored& chunk) const {
    hsize_t stored_bytes = 0;
    if (H5Dget_chunk_storage_size(dataset_, chunk.at.data(), &stored_bytes) < 0 ||
        stored_bytes == 0 || stored_bytes > longest_stored(chunk_bytes_)) {
      throw_damaged(path_, "has chunks of impossible lengths");
    }
    chunk.bytes.resize(stored_bytes);
    std::uint32_t skipped = 0;
    if (H5Dread_chunk(dataset_, H5P_DEFAULT, chunk.at.data(), &skipped, chunk.bytes.data()) < 0) {
      throw_damaged(path_, "has damaged chunks");
    }
    chunk.filters = {};
    for (std::size_t i = 0; i < filters_.size(); ++i) {
      const bool is_applied = (skipped >> i & 1) == 0;
      chunk.filters.shuffle |= is_applied && filters_[i] == H5Z_FILTER_SHUFFLE;
      chunk.filters.deflate |= is_applied && filters_[i] == H5Z_FILTER_DEFLATE;
      chunk.filters.fletcher32 |= is_applied && filters_[i] == H5Z_FILTER_FLETCHER32;
    }
    if (!chunk.filters.deflate &&
        stored_bytes != chunk_bytes_ + (chunk.filters.fletcher32 ? kFletcherBytes : 0)) {
      throw_damaged(path_, "has chunks that are shorter or longer than they should be");
    }
  }

  // Any thread may call.
  void decode(const Stored& chunk, std::span<std::byte> out) const {
    const bool is_whole =
        run_axis_ == 0 && chunk.at[0] >= rows_.first && chunk.at[0] + chunk_[0] <= end_[0];
    std::unique_ptr<std::byte[]> elsewhere;
    std::span<std::byte> data;
    if (is_whole) {
      data = out.subspan((chunk.at[0] - rows_.first) * run_bytes_, chunk_bytes_);
    } else {
      elsewhere = std::make_unique_for_overwrite<std::byte[]>(chunk_bytes_);
      data = {elsewhere.get(), chunk_bytes_};
    }
    if (!undo_filters(chunk.bytes, chunk.filters, element_bytes_, data)) {
      throw_damaged(path_, "is damaged: its checksum or its compression does not hold");
    }
    if (!is_whole) {
      place(data, chunk.at, out);
    }
  }

  // Copies what a chunk holds of the rows, run by run.
  void place(std::span<const std::byte> data, const Coordinates& begin,
             std::span<std::byte> out) const {
    const std::size_t axes = run_axis_ + 1;
    Coordinates from(axes);
    Coordinates to(axes);
    for (std::size_t axis = 0; axis < axes; ++axis) {
      from[axis] = std::max(begin[axis], axis == 0 ? hsize_t{rows_.first} : 0);
      to[axis] = std::min(begin[axis] + chunk_[axis], end_[axis]);
    }
    const std::uint64_t bytes = (to[run_axis_] - from[run_axis_]) * run_bytes_;
    Coordinates at = from;
    for (bool has_more = true; has_more;) {
      std::uint64_t in_chunk = 0;
      std::uint64_t in_rows = 0;
      for (std::size_t axis = 0; axis < axes; ++axis) {
        in_chunk = in_chunk * chunk_[axis] + at[axis] - begin[axis];
        in_rows = in_rows * end_[axis] + at[axis] - (axis == 0 ? rows_.first : 0);
      }
      std::memcpy(out.subspan(in_rows * run_bytes_, bytes).data(),
                  data.subspan(in_chunk * run_bytes_, bytes).data(), bytes);
      has_more = false;
      for (std::size_t axis = run_axis_; axis-- > 0 && !has_more;) {
        has_more = ++at[axis] < to[axis];
        at[axis] = has_more ? at[axis] : from[axis];
      }
    }
  }

  Id dataset_;
  const std::string& path_;
  std::uint64_t element_bytes_;
  Rows rows_;
  Coordinates chunk_;
  Coordinates end_;  // of the rows, and of all other axes
  std::vector<H5Z_filter_t> filters_;
  std::uint64_t chunk_bytes_ = 0;
  std::size_t run_axis_ = 0;     // the last axis that chunks may cut
  std::uint64_t run_bytes_ = 0;  // of one step along it
};

}  // namespace

void read_chunks(Id dataset, const std::string& path, const DatasetSource::Info& info, Rows rows,
                 Decoding decoding, std::span<std::byte> out) {
  ChunkReader(dataset, path, info, rows).read(decoding, out);
}

}  // namespace weft::storage::h5
