#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "core/digest.h"
#include "storage/blob_store.h"

namespace weft::storage {

// A blob read in chunks, its bytes checked against its digest on the way: what a reader holds of it
// is one chunk. One thread. The file stays readable when the blob is trashed meanwhile.
class BlobReader {
 public:
  // Nothing when the blob is absent. It counts as used now.
  [[nodiscard]] static std::optional<BlobReader> open(const BlobStore& store,
                                                      const core::Digest& digest);

  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }
  [[nodiscard]] bool is_over() const { return read_bytes_ == size_bytes_; }
  // Passes over the first bytes; they are read, because the digest covers them. REQUIRES: nothing
  // was read, and there are so many.
  void skip(std::uint64_t bytes);
  // The next bytes: `limit_bytes`, or what is left; nothing at the end. Throws
  // core::Error(kDataLoss), when the last ones were read, if the bytes do not have the digest; the
  // blob is removed then.
  [[nodiscard]] std::string read(std::size_t limit_bytes);

 private:
  BlobReader(const BlobStore& store, const core::Digest& digest, std::uint64_t size_bytes);

  const BlobStore* store_;
  core::Digest digest_;
  std::uint64_t size_bytes_;
  std::uint64_t read_bytes_ = 0;
  std::ifstream file_;
  core::Hasher hasher_;
  bool is_checked_ = false;
};

}  // namespace weft::storage
