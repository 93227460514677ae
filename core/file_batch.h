#pragma once

#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include "core/descriptor.h"

namespace weft::core {

// Many files that become durable together, by two syncs of the whole file system instead of two
// for each file: each stands under a name of its own when all bytes of all files are on the disk.
// Whatever else is unsynced in that file system is waited for, too. One thread.
class FileBatch {
 public:
  // The files lie in `folder` until commit(); it is made, and removed with what is left in it.
  // Throws Error(kUnavailable).
  explicit FileBatch(std::filesystem::path folder);
  ~FileBatch() = default;
  FileBatch(const FileBatch&) = delete;
  FileBatch& operator=(const FileBatch&) = delete;
  FileBatch(FileBatch&&) = delete;
  FileBatch& operator=(FileBatch&&) = delete;

  // A file that will stand at `path`, in the same file system. Throws Error(kUnavailable).
  void write(std::filesystem::path path, std::string_view data);
  // Syncs, renames, syncs. What already stood in the file system is durable, too, on return.
  // Throws Error(kUnavailable); some of the files may then have their names, whole. Once.
  void commit();

 private:
  // Goes with all that is in it.
  struct Folder {
    explicit Folder(std::filesystem::path where);
    ~Folder();
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
    Folder(Folder&&) = delete;
    Folder& operator=(Folder&&) = delete;
    std::filesystem::path path;
  };
  void sync_all() const;

  Folder folder_;
  // Open from the beginning: a file system tells it of all failures since then.
  Descriptor file_system_;
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> moves_;  // from, to
};

}  // namespace weft::core
