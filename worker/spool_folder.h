#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/digest.h"
#include "proto/weft/v1/cluster.pb.h"

namespace weft::worker {

// A folder of one process's unacknowledged work, locked for as long as the process lives; what a
// dead one left can be claimed by any other. For each attempt it holds a file of what the
// coordinator has stored, and for each result that it has not, one with the bytes:
//
//   NUMBER.attempt             fragments of a v1::Completion, each with length and checksum
//   NUMBER.SHARD.DIGEST        the result's bytes; complete when they have that digest
//
// Nothing here is synced when it is written: it survives the process, and sync() makes it survive
// the machine. A torn end is left out, or told by its digest. Not for several threads at once, but
// for the functions on results, which may be called for different results.
class SpoolFolder {
 public:
  // Makes root/name. Throws core::Error(kUnavailable) when that fails.
  static SpoolFolder make(const std::filesystem::path& root, const std::string& name);
  // All folders in `root` whose processes are dead; each is from now on this process's. Removes
  // remains of folders that were being made or removed.
  static std::vector<SpoolFolder> claim_orphans(const std::filesystem::path& root);
  ~SpoolFolder();
  SpoolFolder(SpoolFolder&& other) noexcept;
  SpoolFolder(const SpoolFolder&) = delete;
  SpoolFolder& operator=(const SpoolFolder&) = delete;
  SpoolFolder& operator=(SpoolFolder&&) = delete;

  struct Result {
    std::uint64_t shard = 0;
    core::Digest digest;
    std::uint64_t size_bytes = 0;
  };
  struct Content {
    std::uint64_t number = 0;
    v1::Completion completion;    // the results that the coordinator has stored
    std::vector<Result> results;  // those that it has not, as their files are named
  };
  // What a process left here. Files that belong to no attempt are removed.
  [[nodiscard]] std::vector<Content> load() const;

  // Adds to an attempt's file, the first time its name and token. Throws
  // core::Error(kResourceExhausted) when the disk is full, else kUnavailable.
  void append(std::uint64_t number, const v1::Completion& fragment) const;
  void remove_attempt(std::uint64_t number) const;

  // Errors of write as append's. Read throws core::Error(kDataLoss) when the bytes are not those.
  void write(std::uint64_t number, const Result& result, std::string_view bytes) const;
  [[nodiscard]] std::string read(std::uint64_t number, const Result& result) const;
  void remove(std::uint64_t number, const Result& result) const;
  // Returns without an error when there is no such result any more.
  void sync(std::uint64_t number, const Result& result) const;

  // Removes the folder with all that is in it.
  void discard();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  SpoolFolder(std::filesystem::path path, int lock) : path_(std::move(path)), lock_(lock) {}

  [[nodiscard]] std::filesystem::path attempt_path(std::uint64_t number) const;
  [[nodiscard]] std::filesystem::path result_path(std::uint64_t number, const Result& result) const;

  std::filesystem::path path_;
  int lock_ = -1;  // the descriptor that holds the lock
};

}  // namespace weft::worker
