#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <mutex>
#include <optional>
#include <string>

#include "core/digest.h"
#include "worker/blob_client.h"

namespace weft::worker {

// Inputs of stages, kept on this machine's disk within a limit; the one not used for longest goes
// first. Several workers may use one folder. Any thread.
class InputCache {
 public:
  // Takes over what the folder holds. Throws core::Error(kUnavailable) when it cannot be made.
  InputCache(std::filesystem::path folder, std::uint64_t limit_bytes, BlobClient& client);

  // The blob, from the disk or from the coordinator; errors as BlobClient::read.
  [[nodiscard]] std::string read(const core::Digest& digest,
                                 const std::function<bool()>& should_stop);

 private:
  struct Entry {
    core::Digest digest;
    std::uint64_t size_bytes = 0;
  };

  [[nodiscard]] std::filesystem::path path_of(const core::Digest& digest) const;
  [[nodiscard]] std::optional<std::string> read_from_disk(const core::Digest& digest) const;
  void touch(const core::Digest& digest, std::uint64_t size_bytes);

  std::filesystem::path folder_;
  std::uint64_t limit_bytes_;
  BlobClient& client_;
  std::mutex mutex_;
  std::list<Entry> entries_;  // the one used last first
  std::uint64_t total_bytes_ = 0;
};

}  // namespace weft::worker
