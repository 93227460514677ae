#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "storage/h5.h"

namespace weft::storage {

// Where the datasets of a fabric database come from: the file itself (h5::Reader), or what another
// process read from it (FlatDatabase). All throw core::Error(kDataLoss) naming the dataset.
class DatasetSource {
 public:
  static constexpr std::uint64_t kChunksLimit = 8192;

  struct Info {
    h5::Element element = h5::Element::kF32;
    h5::Shape shape;
    std::uint64_t element_bytes = 0;  // of kText: the fixed length
    std::uint64_t stored_bytes = 0;   // in the file, after compression
    std::uint64_t bytes = 0;          // of all elements
  };

  // Where stored bytes lie: offsets behind the user block.
  struct Extent {
    std::uint64_t offset = 0;
    std::uint64_t size_bytes = 0;
  };

  DatasetSource() = default;
  virtual ~DatasetSource() = default;
  DatasetSource(const DatasetSource&) = delete;
  DatasetSource& operator=(const DatasetSource&) = delete;
  DatasetSource(DatasetSource&&) = delete;
  DatasetSource& operator=(DatasetSource&&) = delete;

  // Whether there is anything of that name; all but optional datasets may be asked for without.
  [[nodiscard]] virtual bool has(const std::string& path) = 0;
  [[nodiscard]] virtual Info info(const std::string& path) = 0;
  // The dataset's stored chunks, kChunksLimit at most.
  [[nodiscard]] virtual std::vector<Extent> chunks(const std::string& path) = 0;
  // Counts a dataset against the limits, before memory is taken for it.
  virtual void admit(const std::string& path, const Info& info) = 0;
  // REQUIRES: `info` is this dataset's and admitted, `out` has info.bytes.
  virtual void read(const std::string& path, const Info& info, std::span<std::byte> out) = 0;
};

}  // namespace weft::storage
