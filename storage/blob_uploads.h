#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <set>
#include <string_view>

#include "core/digest.h"
#include "storage/blob_store.h"

namespace weft::storage {

struct UploadLimits {
  std::size_t kept = 256;                                  // unfinished uploads
  std::uint64_t kept_bytes = std::uint64_t{4} << 30;       // of all of them
  std::int64_t kept_ms = std::int64_t{24} * 3'600 * 1000;  // since the last byte came
};

class BlobUpload;

// Blobs on their way into a store, one file each in the store's folder uploads/. What came of a
// broken upload is kept, so that the next one goes on behind it; the oldest are dropped when there
// are too many. Any thread; one process.
class BlobUploads {
 public:
  // `store` must outlive this.
  explicit BlobUploads(BlobStore& store, UploadLimits limits = {});

  // How much of the blob has come; what a crash may have lost is found out when it is complete.
  [[nodiscard]] std::uint64_t committed_bytes(const core::Digest& digest) const;

  // Goes on with an upload at `offset`; at 0 it begins anew. Nothing when another upload of the
  // blob is under way. Throws core::Error: kInvalidArgument when `offset` is neither 0 nor
  // committed_bytes, kDataLoss when what was kept cannot be read (it is then dropped),
  // kResourceExhausted when the disk is full, kUnavailable when the file cannot be written.
  [[nodiscard]] std::unique_ptr<BlobUpload> begin(const core::Digest& digest,
                                                  std::uint64_t size_bytes, std::uint64_t offset);

  // Drops what has not grown since `before_ms`, and what is over the limits. Says how many.
  std::size_t sweep(std::int64_t before_ms);

 private:
  friend class BlobUpload;
  [[nodiscard]] std::filesystem::path path_of(const core::Digest& digest) const;
  void end(const core::Digest& digest);

  BlobStore& store_;
  std::filesystem::path folder_;
  UploadLimits limits_;
  mutable std::mutex mutex_;
  std::set<core::Digest> active_;
};

// One upload under way. Destroyed before finish(), it leaves what came.
class BlobUpload {
 public:
  BlobUpload(BlobUploads& uploads, const core::Digest& digest, std::uint64_t size_bytes,
             std::uint64_t offset);
  ~BlobUpload();
  BlobUpload(const BlobUpload&) = delete;
  BlobUpload& operator=(const BlobUpload&) = delete;
  BlobUpload(BlobUpload&&) = delete;
  BlobUpload& operator=(BlobUpload&&) = delete;

  // The next bytes. Throws core::Error: kDataLoss when they are more than were announced,
  // kResourceExhausted and kUnavailable as begin().
  void add(std::string_view bytes);
  // Puts the blob into the store; durable on return. Throws core::Error(kDataLoss) when bytes are
  // missing or it has another digest; what came is then dropped, unless bytes are missing.
  void finish();

 private:
  [[noreturn]] void fail(const char* doing) const;
  [[noreturn]] void abandon(const char* doing) const;  // of the constructor
  void drop();

  BlobUploads& uploads_;
  core::Digest digest_;
  std::uint64_t size_bytes_;
  std::uint64_t come_bytes_ = 0;
  std::filesystem::path path_;
  int file_ = -1;
  std::uint64_t unstarted_bytes_ = 0;  // whose way to the disk has not begun
  core::Hasher hasher_;
};

}  // namespace weft::storage
