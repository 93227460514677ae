#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/digest.h"

namespace weft::storage {

// Content-addressed files in one folder: blobs/ab/cdef... Any thread, and any number of processes,
// may use one folder at once; writing what is there already is a success and costs nothing.
class BlobStore {
 public:
  // Creates the folder where needed.
  explicit BlobStore(std::filesystem::path folder);

  // Stores `data` and returns its digest; durable on return.
  core::Digest put(std::string_view data);
  // The blob, checked against its digest; nothing when absent. A damaged blob is removed and counts
  // as absent: it will be computed again.
  [[nodiscard]] std::optional<std::string> get(const core::Digest& digest) const;
  [[nodiscard]] bool has(const core::Digest& digest) const;
  [[nodiscard]] std::filesystem::path path_of(const core::Digest& digest) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace weft::storage
