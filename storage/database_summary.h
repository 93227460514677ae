#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "storage/fabric_database.h"

namespace weft::storage {

// What a dataset takes in the file.
struct StoredDataset {
  std::string path;
  std::string element;  // "f16", "u32", ...
  std::vector<std::uint64_t> shape;
  std::uint64_t stored_bytes = 0;  // after compression
};

// All datasets of the schema, in its order. Throws as read_database.
[[nodiscard]] std::vector<StoredDataset> stored_datasets(const std::filesystem::path& path);

// Where stored bytes of datasets lie in the file.
struct StoredChunk {
  std::uint64_t offset = 0;  // from the beginning of the file
  std::uint64_t size_bytes = 0;
};

// The chunks of all datasets, by offset. Throws as stored_datasets.
[[nodiscard]] std::vector<StoredChunk> stored_chunks(const std::filesystem::path& path);

// How exact the transfer matrices and the visibility are.
struct DatabaseErrors {
  double transfer_rms = 0;        // of all coefficients
  double standard_error_rms = 0;  // of the same
  std::uint64_t fewest_paths = 0;
  std::uint64_t most_paths = 0;
  double mean_open_share = 0;  // of the sphere, over the segments
  double blocked_share = 0;    // of the segments: those that see no sky at all
};
[[nodiscard]] DatabaseErrors database_errors(const FabricDatabase& database);

}  // namespace weft::storage
