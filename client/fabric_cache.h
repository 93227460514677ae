#pragma once

#include <cstdint>
#include <filesystem>

#include "client/fetch_version.h"

namespace weft::client {

// Published versions on disk, each under its content digest, with a list of its pieces beside it;
// those used longest ago go when they take more than the limit. A version is put together from
// pieces of the others as far as they have them. Any number of processes may use one folder; any
// thread may call.
class FabricCache {
 public:
  FabricCache(std::filesystem::path folder, std::uint64_t limit_bytes);

  // The version's file, fetched when it is not there or is damaged, and marked as used. The file
  // may go when others are fetched: read it at once. Throws core::Error: kResourceExhausted when
  // the version alone exceeds the limit, kUnavailable when the folder cannot be written, and what
  // fetch_version throws.
  [[nodiscard]] std::filesystem::path fetch(Coordinator& coordinator, const v1::Version& version,
                                            const FetchReport& report) const;

  // Where pieces of the versions that are here lie.
  [[nodiscard]] PieceIndex pieces() const;

  [[nodiscard]] std::uint64_t size_bytes() const;
  [[nodiscard]] std::uint64_t limit_bytes() const { return limit_bytes_; }

 private:
  void trim(const std::filesystem::path& kept) const;

  std::filesystem::path folder_;
  std::uint64_t limit_bytes_;
};

}  // namespace weft::client
