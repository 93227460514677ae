#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "core/digest.h"
#include "core/file_batch.h"

namespace weft::storage {

// Content-addressed files in one folder: blobs/ab/cdef... Any thread, and any number of processes,
// may use one folder at once; writing what is there already is a success and costs nothing.
//
// A blob that is not needed any more is moved to blobs/trash/, from which it comes back by itself
// when somebody uses, puts or gets it. Only one process may move blobs to the trash.
class BlobStore {
 public:
  // Creates the folder where needed.
  explicit BlobStore(std::filesystem::path folder);

  // Stores `data` and returns its digest; durable on return. It counts as used now.
  core::Digest put(std::string_view data);
  // Likewise. REQUIRES: `digest` is that of `data`.
  void put(const core::Digest& digest, std::string_view data);
  // Many blobs that are durable together, and cost few syncs. Not committed, none of them is there.
  class Batch {
   public:
    // `store` must outlive this.
    explicit Batch(BlobStore& store);
    // What is there already is read, and written again when it is damaged. Says whether it was
    // there. REQUIRES: `digest` is that of `data`.
    bool put(const core::Digest& digest, std::string_view data);
    // All that was put, or was found there, is durable on return. Throws
    // core::Error(kUnavailable). Once.
    void commit();

   private:
    BlobStore& store_;
    core::FileBatch files_;
    std::set<core::Digest> own_;
  };
  // Removes what batches of processes that died have left. REQUIRES: no batch is under way.
  void remove_unfinished() const;
  // Takes over a file that is complete, in the same file system. REQUIRES: its bytes have the
  // digest.
  void adopt(const std::filesystem::path& file, const core::Digest& digest);
  // The blob, checked against its digest; nothing when absent. A damaged blob is removed and counts
  // as absent: it will be computed again.
  [[nodiscard]] std::optional<std::string> get(const core::Digest& digest) const;
  [[nodiscard]] bool has(const core::Digest& digest) const;
  // Marks the blob as used now, and says its size; nothing when absent. It is not moved to the
  // trash before the grace period is over once more, so whoever says that a blob is there uses it
  // first.
  std::optional<std::uint64_t> use(const core::Digest& digest) const;
  void remove(const core::Digest& digest) const;
  [[nodiscard]] std::filesystem::path path_of(const core::Digest& digest) const;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

  struct Entry {
    core::Digest digest;
    std::uint64_t size_bytes = 0;
    std::int64_t used_at_ms = 0;  // of a blob in the trash: since when it lies there
  };
  using Visit = std::function<void(const Entry& entry)>;
  // Calls for every blob, in the order of digests; what comes and goes meanwhile may be left out.
  void visit(const Visit& visit) const;
  void visit_trash(const Visit& visit) const;

  // Moves a blob to the trash unless it was used at `before_ms` or later; whether it was moved.
  bool trash(const core::Digest& digest, std::int64_t before_ms) const;
  // Deletes a blob for good that has lain in the trash since before `before_ms`; whether it did.
  bool empty(const core::Digest& digest, std::int64_t before_ms) const;

 private:
  [[nodiscard]] std::filesystem::path trash_path_of(const core::Digest& digest) const;
  bool restore(const core::Digest& digest) const;  // REQUIRES: mutex_ is held

  std::filesystem::path folder_;
  mutable std::mutex mutex_;  // between use and trash
};

}  // namespace weft::storage
