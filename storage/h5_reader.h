#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "storage/dataset_source.h"
#include "storage/h5.h"

namespace weft::storage::h5 {

// How much a file of so many bytes may unfold to: 32 times its size and 64 MiB, at most 8 GiB.
[[nodiscard]] std::uint64_t decoded_limit_bytes(std::uint64_t file_bytes);

// No chunk of a dataset may be larger.
inline constexpr std::uint64_t kChunkLimitBytes = std::uint64_t{64} << 20;
// No group or dataset may have more attributes, or a longer header.
inline constexpr std::uint64_t kAttributesLimit = 32;
inline constexpr std::uint64_t kHeaderLimitBytes = std::uint64_t{64} << 10;

// Who unfolds chunks: the sandbox may start no threads.
enum class Decoding { kInThisThread, kByAllThreads };

// Reads a file that may be hostile, from memory: refuses what leads out of the file (links,
// external and virtual storage), filters that we do not write, shapes that the file is too small to
// hold, chunks and headers of absurd size, chunks that are missing, and what unfolds to more than
// decoded_limit_bytes (kResourceExhausted). Whoever trusts the library less than this runs it in a
// process of its own (storage/database_reader.cpp).
class Reader : public DatasetSource {
 public:
  // `file` is the whole file, whose HDF5 part begins at `user_block_bytes`. REQUIRES: it outlives
  // the reader. Throws core::Error(kDataLoss) when it is no HDF5 file that begins there.
  Reader(std::span<const std::byte> file, std::uint64_t user_block_bytes, Decoding decoding);

  // Throws unless every object in the file is one of these, reached by hard links alone.
  void require_only(const std::set<std::string>& groups, const std::set<std::string>& datasets);

  [[nodiscard]] bool has(const std::string& path) override;
  [[nodiscard]] Info info(const std::string& path) override;
  [[nodiscard]] std::vector<Extent> chunks(const std::string& path) override;
  void admit(const std::string& path, const Info& info) override;
  void read(const std::string& path, const Info& info, std::span<std::byte> out) override;
  // The rows [first, first + count) of the first axis, which are not admitted. REQUIRES: `info` is
  // this dataset's, there are so many rows, and `out` holds them.
  void read_rows(const std::string& path, const Info& info, std::uint64_t first,
                 std::uint64_t count, std::span<std::byte> out);

 private:
  void require_only_in(const std::string& group, const std::set<std::string>& groups,
                       const std::set<std::string>& datasets) const;
  void check_header(const std::string& path) const;
  [[nodiscard]] Handle open(const std::string& path) const;

  Session session_;
  std::uint64_t file_bytes_ = 0;
  Decoding decoding_;
  std::uint64_t decoded_bytes_ = 0;
  std::uint64_t claimed_bytes_ = 0;
  Handle file_;
};

}  // namespace weft::storage::h5
