#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/flat.h"
#include "storage/dataset_source.h"

namespace weft::storage {

// A database between two processes: one parses the HDF5 file and writes its datasets down plainly
// (core/flat.h), the other takes them for what they are, data that must be checked.

enum class Flattened {
  kArrays,  // everything
  kShapes,  // elements, shapes and where their chunks are stored
};

// Throws what the source throws, and core::Error naming the dataset whose shape contradicts the
// schema.
void flatten_database(DatasetSource& source, Flattened what, core::FlatWriter& out);

// What flatten_database wrote. Trusts nothing in it: lengths are checked against what is there
// before anything is made of them.
class FlatDatabase : public DatasetSource {
 public:
  // REQUIRES: `data` outlives the object. Throws core::Error(kDataLoss) when it is not whole.
  FlatDatabase(std::span<const std::byte> data, Flattened what);

  [[nodiscard]] bool has(const std::string& path) override;
  [[nodiscard]] Info info(const std::string& path) override;
  // REQUIRES: made of shapes.
  [[nodiscard]] std::vector<Extent> chunks(const std::string& path) override;
  void admit(const std::string& path, const Info& info) override;
  void read(const std::string& path, const Info& info, std::span<std::byte> out) override;

 private:
  struct Entry {
    Info info;
    std::span<const std::byte> data;
    std::vector<Extent> chunks;
  };
  const Entry& entry(const std::string& path) const;

  std::map<std::string, Entry> entries_;
};

}  // namespace weft::storage
