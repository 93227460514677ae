#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "core/digest.h"
#include "storage/blob_store.h"

namespace weft::cli {

// What `weft run` has computed so far: result blobs by digest, and an index that says which shard
// gave which result. Any number of processes may use one folder at once. Any thread may call.
class ResultCache {
 public:
  // Opens or makes the folder. Throws core::Error(kUnavailable) when it cannot be written.
  explicit ResultCache(const std::filesystem::path& folder);
  ~ResultCache();
  ResultCache(const ResultCache&) = delete;
  ResultCache& operator=(const ResultCache&) = delete;
  ResultCache(ResultCache&&) = delete;
  ResultCache& operator=(ResultCache&&) = delete;

  // The digest of the shard's result, whose blob is there and undamaged.
  [[nodiscard]] std::optional<core::Digest> find(const core::Digest& shard) const;
  // Stores the result of a shard. After a power failure the index may have forgotten it; it is then
  // computed again.
  core::Digest put(const core::Digest& shard, std::string_view result);
  // A result's bytes. Throws core::Error(kDataLoss) when it has gone or is damaged.
  [[nodiscard]] std::string read(const core::Digest& result) const;

 private:
  void load_index(const std::filesystem::path& path);

  storage::BlobStore blobs_;
  std::filesystem::path index_path_;
  int index_file_ = -1;
  mutable std::mutex mutex_;
  std::map<core::Digest, core::Digest> results_;  // shard -> result
};

// Holds a folder for one process. Throws core::Error(kFailedPrecondition) when another has it.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  FolderLock(FolderLock&&) = delete;
  FolderLock& operator=(FolderLock&&) = delete;

 private:
  int file_ = -1;
};

}  // namespace weft::cli
