#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "storage/h5.h"

namespace weft::storage {

// How a dataset of one database differs from that of another.
struct DatasetDifference {
  std::string path;
  bool is_equal = false;
  h5::Shape shape_from;  // empty: it is not there
  h5::Shape shape_to;
  // Of numbers of equal shape: of the differences, and of the first one's values.
  double largest = 0;
  double rms = 0;
  double rms_from = 0;
};

// All datasets of the schema, in its order. Both files as they are stored, and 16 MiB of a dataset
// of each (a row at least), are in memory. Throws core::Error(kDataLoss) naming the dataset.
// REQUIRES: the files are of our own making, and their digests were checked: they are parsed in
// this process.
[[nodiscard]] std::vector<DatasetDifference> diff_databases(const std::filesystem::path& from,
                                                            const std::filesystem::path& to);

// The description that a database was made from, as JSON. Errors as above.
[[nodiscard]] std::string description_json(const std::filesystem::path& path);

}  // namespace weft::storage
